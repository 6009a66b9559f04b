"""Built-in sensors: the demo sheet of 20 x 30 light dots, clamped; one twice as wide, two cameras; a pad."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from manytouch.values import Camera, Layout, Sensor, Sheet
from manytouch.values.arrays import read_only
from manytouch.values.sensor import Polarity, camera_of_views

ROWS, COLUMNS, PITCH_MM, RADIUS_MM = 20, 30, 4.0, 1.0
PRETENSION_N_PER_MM = 0.4  # stretched on its frame by 2.4 %
DESIGNED_WIDTH_PX = 2560


def demo_sensor(width_px: int = DESIGNED_WIDTH_PX) -> Sensor:
    """The demo sensor with its camera read out at a width; 16:9, 2560 x 1440 as designed.

    Stretched on its frame, the sheet gives each finger a dent of its own; slack, a sheet of this
    thickness joins four fingers in one hollow. The lens has a mild barrel distortion, about
    17 px in the corners of the lattice at 2560 px.
    """
    share = width_px / DESIGNED_WIDTH_PX
    height_px = round(1440 * share)
    camera = Camera(
        width_px=width_px,
        height_px=height_px,
        fx_px=2061.0 * share,
        fy_px=2061.0 * share,
        cx_px=1280.0 * share - 0.5,
        cy_px=720.0 * share - 0.5,
        distortion=read_only(np.array([-0.04, 0.006, 2e-4, -3e-4, 0.0])),
        rotation_vector=read_only(np.zeros(3)),
        translation_mm=read_only(np.array([0.0, 0.0, 116.3])),
    )
    layout = _lattice(ROWS, COLUMNS, PITCH_MM, radius_mm=RADIUS_MM, polarity="light")
    sheet = Sheet(
        size_mm=read_only(np.array([120.0, 80.0])),
        thickness_mm=3.0,
        young_MPa=3.1,
        poisson=0.45,
        pretension_N_per_mm=PRETENSION_N_PER_MM,
        bending_factor=1.0,
        density_kg_m3=960.0,
    )
    return Sensor(
        name="demo sheet",
        camera=camera,
        layout=layout,
        sheet=sheet,
        centre_noise_px=0.03,
        provenance={"origin": "designed, for the simulated sensor"},
    )


SKIN_APART_MM = 100.0


def skin_sensor(width_px: int = DESIGNED_WIDTH_PX) -> Sensor:
    """Three times as wide as high: 240 x 80 mm, 20 x 60 light dots, seen by two cameras of the demo sensor.

    Their views overlap by 45 mm in the middle of the sheet.

    Args:
        width_px: of each picture.
    """
    one = demo_sensor(width_px)
    cameras = {}
    for name, side in (("left", -0.5), ("right", 0.5)):
        translation_mm = one.camera.translation_mm - [side * SKIN_APART_MM, 0.0, 0.0]
        cameras[name] = replace(one.camera, translation_mm=read_only(translation_mm))
    assert one.sheet is not None
    return replace(
        one,
        name="skin",
        camera=camera_of_views(cameras),
        layout=_lattice(ROWS, 60, PITCH_MM, radius_mm=RADIUS_MM, polarity="light"),
        sheet=replace(one.sheet, size_mm=read_only(np.array([240.0, 80.0]))),
    )


PAD_WIDTH_PX = 640


def pad_sensor(width_px: int = PAD_WIDTH_PX) -> Sensor:
    """A pad of 25 x 21 x 4 mm on a window, the size of common commercial ones; 4:3, 640 x 480 as designed.

    The dark dots lie 0.5 mm below the contact face and are seen through silicone and 3 mm of acrylic glass.
    """
    share = width_px / PAD_WIDTH_PX
    camera = Camera(
        width_px=width_px,
        height_px=round(480 * share),
        fx_px=598.0 * share,
        fy_px=598.0 * share,
        cx_px=320.0 * share - 0.5,
        cy_px=240.0 * share - 0.5,
        distortion=read_only(np.array([-0.05, 0.01, 2e-4, -3e-4, 0.0])),
        rotation_vector=read_only(np.zeros(3)),
        translation_mm=read_only(np.array([0.0, 0.0, 25.0])),
    )
    sheet = Sheet(
        size_mm=read_only(np.array([25.0, 21.0])),
        thickness_mm=4.0,
        young_MPa=0.3,
        poisson=0.48,
        boundary="bonded",
        marker_depth_mm=0.5,
        window_mm=3.0,
        window_index=1.49,
        pad_index=1.41,
    )
    return Sensor(
        name="pad",
        camera=camera,
        layout=_lattice(7, 9, 2.0, radius_mm=0.25, polarity="dark"),
        sheet=sheet,
        centre_noise_px=0.03,
        provenance={"origin": "designed, for the simulated sensor"},
    )


def _lattice(rows: int, columns: int, pitch_mm: float, *, radius_mm: float, polarity: Polarity) -> Layout:
    """Markers around the origin."""
    row, column = (index.ravel() for index in np.indices((rows, columns)))
    rest_mm = np.zeros((rows * columns, 3))
    rest_mm[:, 0] = (column - (columns - 1) / 2) * pitch_mm
    rest_mm[:, 1] = (row - (rows - 1) / 2) * pitch_mm
    return Layout(
        rest_mm=read_only(rest_mm),
        row_column=read_only(np.column_stack([row, column]).astype(np.int64)),
        pitch_mm=read_only(np.array([pitch_mm, pitch_mm])),
        radius_mm=read_only(np.full(len(rest_mm), radius_mm)),
        polarity=polarity,
        is_missing=read_only(np.zeros(len(rest_mm), dtype=bool)),
    )


BUILT_IN_SENSORS: Mapping[str, Callable[[int], Sensor]] = {
    "demo": demo_sensor,
    "pad": pad_sensor,
    "skin": skin_sensor,
}
DESIGNED_WIDTHS_PX = {"demo": DESIGNED_WIDTH_PX, "pad": PAD_WIDTH_PX, "skin": DESIGNED_WIDTH_PX}

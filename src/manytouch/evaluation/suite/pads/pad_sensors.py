"""Sensors of the cases of bonded pads: the true one, and a nominal one with wide deviations."""

from dataclasses import replace

import numpy as np

from manytouch.evaluation.suite.pads.cases import PadCase
from manytouch.values import Camera, Layout, Sensor, Sheet
from manytouch.values.arrays import read_only

WIDTH_PX, HEIGHT_PX, FOCAL_PX, DISTANCE_MM = 640, 480, 598.0, 25.0
WINDOW_MM, WINDOW_INDEX, PAD_INDEX = 3.0, 1.49, 1.41
NOMINAL = {"young_MPa": 1.2, "thickness_mm": 1.04}
"""What the nominal sensor states over the truth; its deviations are those of `--sensor gelsight-mini`."""
NOMINAL_POISSON = -0.006
NOMINAL_STD = {"young_MPa": 0.3, "thickness_mm": 0.05, "poisson": 0.01, "marker_depth_mm": 0.1}


def true_pad(case: PadCase, *, width_px: int = WIDTH_PX, centre_noise_px: float = 0.03) -> Sensor:
    """The sensor as it is; its width in pixels and the noise of a dot may be others."""
    return pad_sensor(
        case.title,
        size_mm=(float(case.size_mm[0]), float(case.size_mm[1])),
        thickness_mm=case.thickness_mm,
        young_MPa=case.young_MPa,
        poisson=case.poisson,
        marker_depth_mm=case.marker_depth_mm,
        rows=case.rows,
        columns=case.columns,
        pitch_mm=case.pitch_mm,
        width_px=width_px,
        centre_noise_px=centre_noise_px,
    )


def pad_sensor(
    name: str,
    *,
    size_mm: tuple[float, float],
    thickness_mm: float,
    young_MPa: float,
    poisson: float,
    marker_depth_mm: float,
    rows: int,
    columns: int,
    pitch_mm: float,
    width_px: int = WIDTH_PX,
    centre_noise_px: float = 0.03,
) -> Sensor:
    """Dark dots on a pad bonded to a window of 3 mm, 25 mm from the camera.

    Args:
        name: of the sensor.
        size_mm, thickness_mm, young_MPa, poisson, marker_depth_mm: of the pad.
        rows, columns, pitch_mm: of the dots.
        width_px: of the image, with sides of 4 to 3.
        centre_noise_px: of a dot.
    """
    row, column = (index.ravel() for index in np.indices((rows, columns)))
    middle = 0.5 * (np.array([columns, rows]) - 1.0)
    place_mm = (np.column_stack([column, row]) - middle) * pitch_mm
    height_px, focal_px = width_px * HEIGHT_PX // WIDTH_PX, FOCAL_PX * width_px / WIDTH_PX
    return Sensor(
        name=name,
        camera=Camera(
            width_px=width_px,
            height_px=height_px,
            fx_px=focal_px,
            fy_px=focal_px,
            cx_px=0.5 * (width_px - 1),
            cy_px=0.5 * (height_px - 1),
            distortion=read_only(np.zeros(5)),
            rotation_vector=read_only(np.zeros(3)),
            translation_mm=read_only(np.array([0.0, 0.0, DISTANCE_MM])),
        ),
        layout=Layout(
            rest_mm=read_only(np.column_stack([place_mm, np.zeros(len(place_mm))])),
            row_column=read_only(np.column_stack([row, column]).astype(np.int64)),
            pitch_mm=read_only(np.full(2, pitch_mm)),
            radius_mm=read_only(np.full(len(place_mm), 0.25)),
            polarity="dark",
            is_missing=read_only(np.zeros(len(place_mm), dtype=bool)),
        ),
        sheet=Sheet(
            size_mm=read_only(np.array(size_mm)),
            thickness_mm=thickness_mm,
            young_MPa=young_MPa,
            poisson=poisson,
            boundary="bonded",
            marker_depth_mm=marker_depth_mm,
            window_mm=WINDOW_MM,
            window_index=WINDOW_INDEX,
            pad_index=PAD_INDEX,
        ),
        centre_noise_px=centre_noise_px,
    )


def given_pad(case: PadCase) -> Sensor:
    """The sensor with the numbers that methods are given: the true ones, or nominal ones, less exact."""
    true = true_pad(case)
    sheet = true.sheet
    assert sheet is not None
    if case.group != "pads_nominal":
        return true
    young_MPa, thickness_mm = (
        case.young_MPa * NOMINAL["young_MPa"],
        case.thickness_mm * NOMINAL["thickness_mm"],
    )
    return replace(
        true,
        sheet=replace(
            sheet,
            young_MPa=young_MPa,
            young_std_MPa=NOMINAL_STD["young_MPa"] * young_MPa,
            thickness_mm=thickness_mm,
            thickness_std_mm=NOMINAL_STD["thickness_mm"] * thickness_mm,
            poisson=case.poisson + NOMINAL_POISSON,
            poisson_std=NOMINAL_STD["poisson"],
            marker_depth_std_mm=NOMINAL_STD["marker_depth_mm"],
        ),
    )

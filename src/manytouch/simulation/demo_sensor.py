"""The sensor of the demo: a clamped sheet with 20 x 30 light dots before one camera."""

import numpy as np

from manytouch.values import Camera, Layout, Sensor, Sheet
from manytouch.values.arrays import read_only

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
    row, column = (index.ravel() for index in np.indices((ROWS, COLUMNS)))
    rest_mm = np.zeros((ROWS * COLUMNS, 3))
    rest_mm[:, 0] = (column - (COLUMNS - 1) / 2) * PITCH_MM
    rest_mm[:, 1] = (row - (ROWS - 1) / 2) * PITCH_MM
    layout = Layout(
        rest_mm=read_only(rest_mm),
        row_column=read_only(np.column_stack([row, column]).astype(np.int64)),
        pitch_mm=read_only(np.array([PITCH_MM, PITCH_MM])),
        radius_mm=read_only(np.full(len(rest_mm), RADIUS_MM)),
        polarity="light",
        is_missing=read_only(np.zeros(len(rest_mm), dtype=bool)),
    )
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

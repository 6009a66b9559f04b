"""The true sensor of a case that is not a bonded pad; what the methods are given is in `given`."""

from dataclasses import replace

import numpy as np

from manytouch.evaluation.suite.cases import Case
from manytouch.values import Camera, Layout, Sensor, Sheet
from manytouch.values.arrays import read_only

DESIGNED_WIDTH_PX, FOCAL_PX, DISTANCE_MM = 2560, 2061.0, 116.3  # for a sheet of 120 x 80 mm
EXACT = (
    *("outline_std_mm", "thickness_std_mm", "young_std_MPa", "poisson_std", "pretension_std_N_per_mm"),
    "bending_factor_std",
)
DISTORTION = (-0.04, 0.006, 2e-4, -3e-4, 0.0)


def true_sensor(case: Case) -> Sensor:
    """The sensor as it is: the sheet just fits into the picture, the lens has a mild barrel distortion."""
    width_mm, height_mm = case.size_mm
    share = case.width_px / DESIGNED_WIDTH_PX
    camera = Camera(
        width_px=case.width_px,
        height_px=round(1440 * share),
        fx_px=FOCAL_PX * share,
        fy_px=FOCAL_PX * share,
        cx_px=1280.0 * share - 0.5,
        cy_px=720.0 * share - 0.5,
        distortion=read_only(np.array(DISTORTION)),
        rotation_vector=read_only(np.zeros(3)),
        translation_mm=read_only(np.array([0.0, 0.0, DISTANCE_MM * max(width_mm / 120.0, height_mm / 80.0)])),
    )
    sheet = Sheet(
        size_mm=read_only(np.array(case.size_mm)),
        thickness_mm=case.thickness_mm,
        young_MPa=case.young_MPa,
        poisson=case.poisson,
        pretension_N_per_mm=case.pretension_N_per_mm,
        bending_factor=1.0,
    )
    return Sensor(name=case.title, camera=camera, layout=lattice(case), sheet=sheet, centre_noise_px=0.03)


def lattice(case: Case) -> Layout:
    """As many dots as fit on the sheet, without those that were not printed.

    `is_missing` of this true layout has the latter; methods are given one `with_all_dots`.
    """
    columns, rows = (int(size // case.pitch_mm) for size in case.size_mm)
    row, column = (index.ravel() for index in np.indices((rows, columns)))
    rest_mm = np.zeros((rows * columns, 3))
    rest_mm[:, 0] = (column - (columns - 1) / 2) * case.pitch_mm
    rest_mm[:, 1] = (row - (rows - 1) / 2) * case.pitch_mm
    missing = np.random.default_rng(case.seed).random(len(rest_mm)) < case.missing_share
    return Layout(
        rest_mm=read_only(rest_mm),
        row_column=read_only(np.column_stack([row, column]).astype(np.int64)),
        pitch_mm=read_only(np.full(2, case.pitch_mm)),
        radius_mm=read_only(np.full(len(rest_mm), case.pitch_mm / 4)),
        polarity="light",
        is_missing=read_only(missing),
    )


def exact_sensor(sensor: Sensor) -> Sensor:
    """The sensor with a sheet whose file states that its numbers are exact."""
    assert sensor.sheet is not None
    exact = dict.fromkeys(EXACT, 0.0)
    return replace(sensor, sheet=replace(sensor.sheet, **exact))  # type: ignore[arg-type]


def with_all_dots(sensor: Sensor) -> Sensor:
    """The sensor with every dot printed."""
    assert sensor.layout is not None
    missing = read_only(np.zeros(len(sensor.layout.rest_mm), dtype=bool))
    return replace(sensor, layout=replace(sensor.layout, is_missing=missing))

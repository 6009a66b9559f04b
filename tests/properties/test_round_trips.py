"""What is written can be read again: sensor files to the last bit, tables to the digits that they state."""

import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from layouts import lattice_layout, marker_layout
from manytouch.simulation.demo_sensor import demo_sensor
from manytouch.sinks.files.tables import ContactTable, MarkerTable
from manytouch.values import Camera, Contacts, Phase, Sensor, Sheet
from manytouch.values.sensor_file.read import load_sensor
from manytouch.values.sensor_file.write import save_sensor
from results import rows_of
from same_bits import assert_same_bits
from viewer_session import reading_of

# with CHECK_TYPES=1 the type checker draws the elements that it checks from `random`
pytestmark = pytest.mark.filterwarnings("ignore:Do not use the `random` module inside strategies")

SENSOR = demo_sensor(320)  # of `reading_of`
EXAMPLES = settings(max_examples=25)


def between(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_nan=False)


def vectors(count: int, low: float, high: float) -> st.SearchStrategy[np.ndarray]:
    return st.lists(between(low, high), min_size=count, max_size=count).map(np.array)


CAMERAS = st.one_of(
    *(
        st.builds(
            Camera,
            model=st.just(model),
            width_px=st.integers(640, 8000),
            height_px=st.integers(640, 8000),
            fx_px=between(200.0, 1e4),
            fy_px=between(200.0, 1e4),
            cx_px=between(0.0, 4000.0),
            cy_px=between(0.0, 4000.0),
            distortion=vectors(count, -0.5, 0.5),
            rotation_vector=vectors(3, -0.5, 0.5),
            translation_mm=st.tuples(between(-9.0, 9.0), between(-9.0, 9.0), between(20.0, 300.0)).map(
                np.array
            ),
        )
        for model, count in (("pinhole", 5), ("fisheye", 4))
    )
)
SHEETS = st.builds(
    Sheet,
    size_mm=vectors(2, 200.0, 400.0),
    thickness_mm=between(0.5, 10.0),
    young_MPa=st.none() | between(0.05, 50.0),
    poisson=st.none() | between(0.1, 0.49),
    pretension_N_per_mm=st.none() | between(0.0, 1.0),
    bending_factor=st.none() | between(0.2, 2.0),
    density_kg_m3=st.none() | between(500.0, 2000.0),
)
LAYOUTS = st.one_of(
    st.builds(
        lattice_layout,
        rows=st.integers(2, 6),
        columns=st.integers(2, 6),
        pitch_mm=vectors(2, 2.0, 9.0),
        radius_mm=between(0.1, 0.9),
        polarity=st.sampled_from(["light", "dark"]),
        missing=st.sets(st.integers(0, 3)).map(sorted),
    ),
    st.builds(
        lambda jitter, radius_mm, polarity: marker_layout(
            5.0 * np.column_stack([np.arange(8) % 3, np.arange(8) // 3]) + jitter.reshape(8, 2),
            radius_mm=radius_mm,
            polarity=polarity,
        ),
        jitter=vectors(16, -1.0, 1.0),
        radius_mm=vectors(8, 0.1, 0.9),
        polarity=st.sampled_from(["light", "dark"]),
    ),
)


@EXAMPLES
@given(camera=CAMERAS, sheet=st.none() | SHEETS, layout=LAYOUTS, noise_px=st.none() | between(1e-3, 1.0))
def test_a_saved_sensor_reads_back_the_same(camera, sheet, layout, noise_px) -> None:
    sensor = Sensor(name="any", camera=camera, sheet=sheet, layout=layout, centre_noise_px=noise_px)
    with tempfile.TemporaryDirectory() as folder:
        save_sensor(sensor, Path(folder) / "sensor.toml")
        again = load_sensor(Path(folder) / "sensor.toml")
    assert_same_bits(again.camera, camera)
    assert_same_bits(again.sheet, sheet)
    assert again.centre_noise_px == noise_px
    assert again.layout is not None
    for name in ("row_column", "radius_mm", "polarity", "is_missing"):
        assert_same_bits(getattr(again.layout, name), getattr(layout, name), name)
    # a lattice is written as its pitch, and its positions are computed again
    np.testing.assert_allclose(again.layout.rest_mm, layout.rest_mm, rtol=0, atol=1e-11)


NUMBERS = st.one_of(between(-1e3, 1e3), between(-1e-3, 1e-3), st.just(float("nan")))


CONTACTS = st.fixed_dictionaries(
    {
        "depth_mm": NUMBERS,
        "centre_mm": vectors(2, -60.0, 60.0),
        "centre_px": vectors(2, 0.0, 4000.0),
        "force_N": st.tuples(NUMBERS, NUMBERS, NUMBERS).map(np.array),
        "area_mm2": NUMBERS,
        "slip": st.none() | st.booleans(),
        "phase": st.sampled_from(Phase),
    }
)


@EXAMPLES
@given(known=CONTACTS, std=vectors(3, 1e-4, 10.0))
def test_a_contact_is_read_from_its_row(known: dict[str, Any], std: np.ndarray) -> None:
    reading = reading_of(3)
    covariance = np.full((8, 8), np.nan)
    covariance[range(3), range(3)] = std**2
    contact = replace(reading.contacts.contacts[0], covariance=covariance, **known)
    with tempfile.TemporaryDirectory() as folder:
        table = ContactTable(Path(folder), SENSOR)
        table.write(replace(reading, contacts=Contacts(contacts=(contact,))))
        table.close()
        (row,) = rows_of(Path(folder) / "contacts.csv")
    x_N, y_N, z_N = known["force_N"]
    wanted = {
        **dict(zip(("x_mm", "y_mm"), known["centre_mm"], strict=True)),
        **dict(zip(("x_px", "y_px"), known["centre_px"], strict=True)),
        **{"shear_x_N": x_N, "shear_y_N": y_N, "normal_force_N": -z_N},
        **dict(zip(("x_std_mm", "y_std_mm", "depth_std_mm"), std, strict=True)),
        **{name: known[name] for name in ("depth_mm", "area_mm2")},
    }
    for name, value in wanted.items():
        found = float(row[name]) if row[name] else float("nan")
        assert found == pytest.approx(float(value), rel=5.1e-6, nan_ok=True), name
    assert row["phase"] == known["phase"].value
    assert row["slip"] == ("" if known["slip"] is None else str(int(known["slip"])))


@EXAMPLES
@given(seed=st.integers(0, 2**32 - 1), share=between(0.0, 1.0))
def test_markers_are_read_to_a_ten_thousandth_of_a_pixel(seed: int, share: float) -> None:
    reading, chance = reading_of(5), np.random.default_rng(seed)
    count = len(reading.grid.position_px)
    is_seen = chance.random(count) < share
    position_px = np.where(is_seen[:, None], chance.uniform(0.0, 4e3, (count, 2)), np.nan)
    moved_mm = chance.normal(0.0, 3.0, (count, 3))
    with tempfile.TemporaryDirectory() as folder:
        table = MarkerTable(Path(folder), SENSOR)
        table.write(
            replace(
                reading,
                grid=replace(reading.grid, position_px=position_px, is_seen=is_seen),
                surface=replace(reading.surface, displacement_mm=moved_mm),
            )
        )
        table.close()
        found = pq.read_table(Path(folder) / "markers.parquet").to_pydict()
    assert found["seen"] == is_seen.tolist()
    for name, value in (("x_px", position_px[:, 0]), ("y_px", position_px[:, 1])):
        read = np.array([np.nan if each is None else each for each in found[name]])
        np.testing.assert_allclose(read, value, rtol=1e-7, atol=1e-4)
    for name, value in (("dx_mm", moved_mm[:, 0]), ("depth_mm", -moved_mm[:, 2])):
        read = np.array([np.nan if each is None else each for each in found[name]])
        np.testing.assert_allclose(read, value, rtol=1e-7, atol=1e-5)

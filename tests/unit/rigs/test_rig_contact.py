"""A contact in rig coordinates, with its standard deviations, and its row."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from contacts import contact_with
from manytouch.rigs.rig_contact import COLUMNS, RigContact, in_rig
from manytouch.rigs.rig_file import RigSensor
from manytouch.simulation.demo_sensor import demo_sensor
from manytouch.sinks.files.tables import contact_column_names
from manytouch.values import Frame, Phase

FRAME = Frame(index=7, timestamp_ns=1_500_000_000, camera="", image=None)
CONTACT = contact_with(
    id=3,
    phase=Phase.START,
    centre_mm=np.array([1.0, 2.0]),
    centre_px=np.array([10.0, 20.0]),
    depth_mm=0.5,
    force_N=np.array([1.0, 0.0, -4.0]),
    torque_Nmm=2.5,
    area_mm2=12.0,
    covariance=np.diag([0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8]) ** 2,
    slip=False,
)


def on_rig(rotation_vector: tuple[float, float, float]) -> RigSensor:
    return RigSensor(
        name="thumb",
        source="sim:one",
        sensor=None,
        method=None,
        fps=None,
        size_px=None,
        rotation=Rotation.from_rotvec(rotation_vector).as_matrix(),
        translation_mm=np.array([10.0, 20.0, 30.0]),
    )


def found(rotation_vector: tuple[float, float, float]) -> RigContact:
    return in_rig(CONTACT, demo_sensor(640), on_rig(rotation_vector), FRAME)


def test_a_contact_is_turned_and_moved() -> None:
    contact = found((0.0, 0.0, np.pi / 2))
    assert contact.position_mm == pytest.approx((10.0 - 2.0, 20.0 + 1.0, 30.0 - 0.5))
    assert contact.force_N == pytest.approx((0.0, 1.0, -4.0))
    assert (contact.id, contact.phase, contact.frame, contact.depth_mm) == (3, "start", 7, 0.5)
    assert contact.sensor_time_s == 1.5


def test_standard_deviations_turn_with_it() -> None:
    contact = found((0.0, 0.0, np.pi / 2))
    assert contact.position_std_mm == pytest.approx((0.2, 0.1, 0.3))
    assert contact.force_std_N == pytest.approx((0.5, 0.4, 0.6))
    assert found((np.pi / 2, 0.0, 0.0)).position_std_mm == pytest.approx((0.1, 0.3, 0.2))


def test_a_row_has_all_columns_of_a_single_sensor() -> None:
    row = dict(zip(COLUMNS, found((0.0, 0.0, np.pi / 2)).row("thumb", 2.25), strict=True))
    prefixed = {"x_mm", "y_mm", "x_std_mm", "y_std_mm"}
    for name in contact_column_names("mm"):
        assert (f"sheet_{name}" if name in prefixed else name) in row, name
    assert (row["time_s"], row["sensor_time_s"], row["sensor"]) == ("2.250000", "1.500000", "thumb")
    assert (row["x_mm"], row["sheet_x_mm"], row["sheet_x_std_mm"]) == ("8", "1", "0.1")
    assert (row["area_mm2"], row["torque_Nmm"], row["torque_std_Nmm"]) == ("12", "2.5", "0.7")
    assert (row["normal_force_N"], row["force_std_N"], row["slip"], row["half_major_mm"]) == (
        "4",
        "0.6",
        0,
        "",
    )


def test_without_a_scale_there_are_no_lengths() -> None:
    sensor = replace(demo_sensor(640), scale_is_known=False)
    contact = in_rig(CONTACT, sensor, on_rig((0.0, 0.0, 0.0)), FRAME)
    row = dict(zip(COLUMNS, contact.row("thumb", 0.0), strict=True))
    assert {name for name, value in row.items() if name.endswith(("_mm", "_mm2")) and value != ""} == set()
    assert row["x_px"] == "10"

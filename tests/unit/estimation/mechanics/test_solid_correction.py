"""Laws of the depth of a solid's face minus that of a shell."""

from dataclasses import replace

import numpy as np
import pytest

from manytouch.estimation.mechanics.force_clusters import Clusters
from manytouch.estimation.mechanics.sheet_model import InversionModel, NominalSheet
from manytouch.estimation.mechanics.solid_correction import SolidCorrection
from manytouch.values import Camera, Layout, Sensor, Sheet

FACE = SolidCorrection()
ROW, COLUMN = (index.ravel() for index in np.indices((8, 10)))


def model_of(scale: float = 1.0, *, is_known: bool = True) -> InversionModel:
    rest_mm = np.zeros((80, 3))
    rest_mm[:, :2] = np.column_stack([COLUMN - 4.5, ROW - 3.5]) * 4.0 * scale
    sheet = Sheet(
        size_mm=np.array([40.0, 32.0]) * scale,
        thickness_mm=3.0 * scale,
        young_MPa=1.0,
        poisson=0.45,
        pretension_N_per_mm=0.0,
        bending_factor=1.0,
    )
    camera = Camera(
        width_px=800,
        height_px=600,
        fx_px=900.0,
        fy_px=900.0,
        cx_px=399.5,
        cy_px=299.5,
        distortion=np.zeros(5),
        rotation_vector=np.zeros(3),
        translation_mm=np.array([0.0, 0.0, 60.0]) * scale,
    )
    layout = Layout(
        rest_mm=rest_mm,
        row_column=np.column_stack([ROW, COLUMN]).astype(np.int64),
        pitch_mm=np.full(2, 4.0 * scale),
        radius_mm=np.full(80, scale),
        polarity="light",
        is_missing=np.zeros(80, dtype=bool),
    )
    return NominalSheet()(
        Sensor(name="test", camera=camera, layout=layout, sheet=sheet if is_known else None)
    )


def press(force_mm2: float, variance_mm2: float = 0.0, scale: float = 1.0) -> Clusters:
    return Clusters(
        centre_mm=np.array([[2.0, -1.0]]) * scale,
        force_mm2=np.array([[0.0, 0.0, -force_mm2]]),
        torque_mm3=np.zeros(1),
        spread_mm2=variance_mm2 * np.eye(2)[None],
        centre_covariance_mm2=np.full((1, 2, 2), np.nan),
        contact_area_mm2=np.full(1, np.nan),
        contact_area_std_mm2=np.full(1, np.nan),
        label=np.zeros(0, dtype=np.int64),
    )


def test_a_press_dents_most_under_itself_and_lifts_a_ring_around() -> None:
    away_mm = np.array([[2.0 + r, -1.0] for r in (0.0, 1.0, 2.7, 20.0)])
    under, near, ring, far = FACE.depth_under_contacts(model_of(), press(0.6), away_mm)
    assert under == pytest.approx((FACE.dent - FACE.ring) * 0.6 / 3.0)
    assert under > near > 0.0 > ring
    assert abs(far) < 1e-6
    wide = FACE.depth_under_contacts(model_of(), press(0.6, 40.0), away_mm)
    assert abs(wide[0]) < 0.2 * under


@pytest.mark.parametrize("scale", [0.5, 2.0])
def test_everything_scales_with_the_sheet(scale: float) -> None:
    place_mm = np.array([[2.0, 0.5], [5.0, 1.0]])
    one = FACE.depth_under_contacts(model_of(), press(0.6, 12.0), place_mm)
    other = FACE.depth_under_contacts(
        model_of(scale), press(0.6 * scale**2, 12.0 * scale**2, scale), place_mm * scale
    )
    np.testing.assert_allclose(other, scale * one, rtol=1e-9)
    shape = np.random.default_rng(0).normal(0, 0.1, (model_of().patch.node_count, 3))
    clamp = FACE.depth_along_clamp(model_of(), shape)
    np.testing.assert_allclose(
        FACE.depth_along_clamp(model_of(scale), scale * shape), scale * clamp, rtol=1e-9
    )


def test_the_clamp_correction_is_near_the_clamp() -> None:
    model = model_of()
    bowl = np.zeros((model.patch.node_count, 3))
    half_mm = 0.5 * np.array(model.patch.size_mm)
    bowl[:, 2] = -np.prod(1.0 - (model.patch.place_mm / half_mm) ** 2, axis=1)
    added = FACE.depth_along_clamp(model, bowl).reshape(8, 10)
    assert (added >= 0.0).all()
    assert added[4, 0] > 2.0 * added[4, 1] > 4.0 * added[4, 3]
    assert FACE.depth_along_clamp(model, np.zeros_like(bowl)).max() == 0.0


def test_a_sheet_that_was_assumed_is_a_shell() -> None:
    model = model_of(is_known=False)
    shape = np.ones((model.patch.node_count, 3))
    assert not FACE.depth_under_contacts(model, press(1.0), np.zeros((3, 2))).any()
    assert not FACE.depth_along_clamp(model, shape).any()
    assert replace(FACE, dent=1.0).depth_under_contacts(model_of(), press(1.0), np.zeros((1, 2)))[0] > 0.0

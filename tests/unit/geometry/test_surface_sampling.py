"""Sampled surfaces against shapes and forces that are known everywhere."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import manytouch
from manytouch.errors import SensorError
from manytouch.geometry.sheet_face import sheet_face
from manytouch.geometry.spline.patch import SplinePatch
from manytouch.geometry.surface_sampling import SurfaceSampler, sampler_at, sampler_on
from manytouch.mechanics.markers.images import Face
from manytouch.mechanics.shell.shell import Shell
from manytouch.simulation.demo_sensor import demo_sensor
from manytouch.values import Interpolation, SheetSpline, Surface

SIZE_MM, YOUNG_MPA, THICKNESS_MM = (120.0, 80.0), 2.0, 3.0
PATCH = SplinePatch(size_mm=SIZE_MM, elements=(30, 20))
SHELL = Shell(patch=PATCH, thickness_mm=THICKNESS_MM, poisson=0.45)
LAYOUT = demo_sensor(320).layout
X_MM, Y_MM = np.linspace(-58, 58, 117), np.linspace(-38, 38, 77)


def surface_of(
    displacement_mm: np.ndarray, spline: SheetSpline | None = None, *, std_mm: float = 0.1
) -> Surface:
    return Surface(
        position_mm=LAYOUT.rest_mm + displacement_mm,
        displacement_mm=displacement_mm,
        covariance_mm2=np.tile(std_mm**2 * np.eye(3), (len(displacement_mm), 1, 1)),
        spline=spline,
        layout=LAYOUT,
    )


def spline_of(
    *,
    force_N: np.ndarray | None = None,
    coefficient_mm: np.ndarray | None = None,
    patch: SplinePatch = PATCH,
) -> SheetSpline:
    over_E = np.zeros((patch.node_count, 3))
    if force_N is not None:
        over_E[:, 2] = force_N / YOUNG_MPA
    return SheetSpline(
        size_mm=patch.size_mm,
        centre_mm=patch.centre_mm,
        elements=patch.elements,
        is_clamped=patch.boundary == "clamped",
        thickness_mm=THICKNESS_MM,
        poisson=0.45,
        shear_mm2=SHELL.shear_mm2,
        tilt_mm2=SHELL.tilt_mm2,
        clamped_end=SHELL.patch.clamped_end if patch.boundary == "clamped" else (0.0, 0.0, 0.0),
        coefficient_mm=np.zeros((patch.node_count, 3)) if coefficient_mm is None else coefficient_mm,
        force_over_E_mm2=over_E,
        young_MPa=YOUNG_MPA,
    )


def dented_surface(depth_mm: float = 1.5) -> Surface:
    """A dent as narrow as the pitch, which values at the markers do not show."""
    coefficient_mm = np.zeros((PATCH.node_count, 3))
    coefficient_mm[np.argmin(np.hypot(*(PATCH.place_mm - (2.0, 2.0)).T)), 2] = -depth_mm
    at_markers = Face(shell=SHELL, point_mm=np.ascontiguousarray(LAYOUT.rest_mm[:, :2]))
    return surface_of(at_markers.displacement(coefficient_mm), spline_of(coefficient_mm=coefficient_mm))


@pytest.fixture(scope="module")
def grid() -> SurfaceSampler:
    return sampler_on(LAYOUT, X_MM, Y_MM)


@pytest.mark.parametrize("size_mm", [(48.0, 36.0), (30.0, 48.0)])
@pytest.mark.parametrize("boundary", ["clamped", "soft"])
def test_the_face_moves_as_in_the_mechanics(size_mm: tuple[float, float], boundary: str) -> None:
    elements = (round(size_mm[0] / 4), round(size_mm[1] / 4))
    patch = SplinePatch(size_mm=size_mm, elements=elements, boundary=boundary, centre_mm=(2.0, -1.0))
    random = np.random.default_rng(5)
    coefficient_mm = random.normal(scale=0.1, size=(patch.node_count, 3))
    point_mm = np.array(patch.centre_mm) + (random.random((200, 2)) - 0.5) * size_mm
    expected = Face(shell=replace(SHELL, patch=patch), point_mm=point_mm).displacement(coefficient_mm)
    spline = spline_of(coefficient_mm=coefficient_mm, patch=patch)
    np.testing.assert_allclose(sheet_face(spline, point_mm).displacement_mm(spline), expected, atol=1e-9)


@pytest.mark.parametrize("kind", ["spline", "idw"])
@pytest.mark.parametrize("has_rows", [True, False])
@pytest.mark.parametrize("has_spline", [True, False])
def test_no_points_give_no_values(kind: str, has_rows: bool, has_spline: bool) -> None:
    layout = LAYOUT if has_rows else replace(LAYOUT, row_column=None)
    surface = replace(dented_surface(), layout=layout, interpolation=Interpolation(kind=kind))
    found = manytouch.sample(
        surface if has_spline else replace(surface, spline=None), np.zeros(0), np.zeros(0)
    )
    shapes = {name: getattr(found, name).shape for name in type(found).__slots__}
    assert shapes == {name: (0, 3) if name == "displacement_mm" else (0,) for name in shapes}


def test_points_and_grid_give_the_same_fields(grid: SurfaceSampler) -> None:
    surface = dented_surface()
    surface = replace(surface, displacement_mm=surface.displacement_mm + 0.01 * LAYOUT.rest_mm[:, [1, 0, 0]])
    x_mm, y_mm = (place.ravel()[::37] for place in np.meshgrid(X_MM, Y_MM))
    found = manytouch.sample(surface, x_mm, y_mm)
    for name, field in (
        ("depth_mm", grid.depth(surface)),
        ("depth_std_mm", grid.depth_std(surface)),
        ("strain", grid.strain(surface)),
        ("pressure_kPa", grid.pressure_kPa(surface)),
    ):
        np.testing.assert_allclose(getattr(found, name), field.ravel()[::37], atol=1e-9, err_msg=name)


@settings(max_examples=20, deadline=None)
@given(marker=st.integers(0, len(LAYOUT.rest_mm) - 1), has_spline=st.booleans())
def test_markers_keep_their_depth_and_deviation(marker: int, has_spline: bool) -> None:
    surface = dented_surface()
    random = np.random.default_rng(marker)
    displacement_mm = surface.displacement_mm + random.normal(0.0, 0.2, surface.displacement_mm.shape)
    surface = replace(surface, displacement_mm=displacement_mm, spline=surface.spline if has_spline else None)
    found = manytouch.sample(surface, *LAYOUT.rest_mm[[marker], :2].T)
    np.testing.assert_allclose(found.displacement_mm[0], displacement_mm[marker], atol=1e-9)
    assert found.depth_mm[0] == -found.displacement_mm[0, 2]
    assert found.depth_std_mm[0] == pytest.approx(0.1, rel=1e-6)


def test_outside_and_next_to_unknown_markers_nothing_is_known() -> None:
    surface = dented_surface()
    unknown_mm = surface.displacement_mm.copy()
    unknown_mm[0] = np.nan
    surface = replace(surface, displacement_mm=unknown_mm)
    corner_mm = LAYOUT.rest_mm[0, :2]
    x_mm, y_mm = np.array([900.0, corner_mm[0] - 3.0, corner_mm[0]]), np.array([0.0, 0.0, corner_mm[1]])
    found = manytouch.sample(surface, x_mm, y_mm)
    assert np.isnan(found.depth_mm).all()
    assert np.isnan(found.strain).all()
    assert np.isnan(found.pressure_kPa[:2]).all()
    with pytest.raises(SensorError, match="without a layout"):
        manytouch.sample(replace(surface, layout=None), x_mm, y_mm)


def test_pressure_adds_up_to_the_force_and_peaks_where_it_presses(grid: SurfaceSampler) -> None:
    force_N = SHELL.patch.load(np.array([[-20.0, 10.0]]), np.array([[0.0, 0.0, -3.0]]))[:, 2]
    found = grid.pressure_kPa(surface_of(np.zeros_like(LAYOUT.rest_mm), spline_of(force_N=force_N)))
    total_N = np.trapezoid(np.trapezoid(found, X_MM, axis=1), Y_MM) * 1e-3
    assert total_N == pytest.approx(3.0, rel=0.01)
    row, column = np.unravel_index(int(found.argmax()), found.shape)
    assert abs(X_MM[column] + 20.0) <= 1.0
    assert abs(Y_MM[row] - 10.0) <= 1.0


def test_without_a_modulus_or_forces_there_is_no_pressure(grid: SurfaceSampler) -> None:
    still = np.zeros_like(LAYOUT.rest_mm)
    assert np.isnan(grid.pressure_kPa(surface_of(still, replace(spline_of(), young_MPa=None)))).all()
    assert np.isnan(grid.pressure_kPa(surface_of(still))).all()


def test_a_spline_is_evaluated_and_not_interpolated_between_markers(grid: SurfaceSampler) -> None:
    surface = dented_surface()
    column, row = int(np.argmin(np.abs(X_MM - 2.0))), int(np.argmin(np.abs(Y_MM - 2.0)))
    point = Face(shell=SHELL, point_mm=np.array([[X_MM[column], Y_MM[row]]]))
    expected = -point.displacement(surface.spline.coefficient_mm)[0, 2]
    depth = grid.depth(surface)
    assert depth[row, column] == pytest.approx(expected, abs=1e-9)
    lower = surface.displacement_mm - [0.0, 0.0, 0.25]
    np.testing.assert_allclose(grid.depth(replace(surface, displacement_mm=lower)), depth + 0.25, atol=1e-9)
    interpolated = grid.depth(replace(surface, spline=None))
    assert np.nanmax(np.abs(interpolated - depth)) > 0.005, "the dent does not distinguish the two"


def test_strain_of_a_stretched_and_tilted_sheet(grid: SurfaceSampler) -> None:
    x, y = LAYOUT.rest_mm[:, 0], LAYOUT.rest_mm[:, 1]
    moved = np.column_stack([0.1 * x, 0.02 * y, -0.3 * x])
    np.testing.assert_allclose(grid.strain(surface_of(moved)), 0.1 + 0.5 * (0.1**2 + 0.3**2), rtol=1e-6)
    sheared = np.column_stack([0.2 * y, 0.0 * x, 0.0 * x])
    xx, yy, xy = 0.0, 0.5 * 0.2**2, 0.5 * 0.2
    largest = 0.5 * (xx + yy) + np.hypot(0.5 * (xx - yy), xy)
    np.testing.assert_allclose(grid.strain(surface_of(sheared)), largest, rtol=1e-6)


def test_rotation_causes_no_strain(grid: SurfaceSampler) -> None:
    x, y = LAYOUT.rest_mm[:, 0], LAYOUT.rest_mm[:, 1]
    angle = 0.3
    moved = np.column_stack(
        [x * (np.cos(angle) - 1) - y * np.sin(angle), x * np.sin(angle) + y * (np.cos(angle) - 1), 0.0 * x]
    )
    assert np.nanmax(np.abs(grid.strain(surface_of(moved)))) < 1e-9


def test_deviations_need_a_posterior_and_grow_with_it() -> None:
    point_mm = np.array([[2.0, 2.0], [-30.0, 10.0]])
    sampler, surface = sampler_at(LAYOUT, point_mm), dented_surface()
    assert np.isnan(sampler.strain_std(surface, ())).all()
    assert np.isnan(sampler.pressure_std_kPa(surface, ())).all()
    deeper = [dented_surface(depth).spline for depth in (1.4, 1.6)]
    found = manytouch.sample(surface, *point_mm.T, posterior=deeper)
    assert found.strain_std[0] > 0.4 * found.strain[0] > 0.0
    wider = manytouch.sample(surface, *point_mm.T, posterior=[dented_surface(3.0).spline] * 2)
    assert wider.strain_std[0] > found.strain_std[0]
    stiff = replace(surface.spline, force_over_E_mm2=np.ones_like(surface.spline.force_over_E_mm2))
    assert (sampler.pressure_std_kPa(surface, [stiff]) > 0.0).all()

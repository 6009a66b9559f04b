"""From the bent sheet to the image: signs, the lever, the deformed disc, derivatives."""

from dataclasses import replace
from unittest import mock

import numpy as np
import pytest

import spline_reference as reference
from manytouch.geometry.camera import project
from manytouch.geometry.spline.patch import SplinePatch
from manytouch.mechanics.markers.discs import disc_places
from manytouch.mechanics.markers.images import Face, MarkerImages
from manytouch.mechanics.shell.shell import Shell
from manytouch.values import Camera

H = 1e-4


def test_a_press_comes_nearer_to_the_camera_and_moves_dots_outwards(
    dots: MarkerImages, patch: SplinePatch
) -> None:
    straight = replace(dots.camera, rotation_vector=np.zeros(3), translation_mm=np.array([0.0, 0.0, 90.0]))
    seen = replace(dots, camera=replace(straight, distortion=np.zeros(5)))
    down = np.zeros((patch.node_count, 3))
    down[:, 2] = -2.0  # in the middle, far from a clamped outline, an even shift
    moved = seen.displacement_px(down * patch.is_free)
    middle = np.linalg.norm(dots.rest_mm[:, :2] - np.array(patch.centre_mm), axis=1) < 6.0
    outwards = (moved * dots.rest_mm[:, :2]).sum(axis=1)[middle]
    assert (outwards[np.linalg.norm(dots.rest_mm[middle, :2], axis=1) > 0.5] > 0.0).all()
    depth = -seen.displacement_mm(down * patch.is_free)[middle, 2]
    np.testing.assert_allclose(depth, 2.0, atol=0.05)


@pytest.mark.parametrize("height_mm", [0.0, 0.7])
def test_the_lever_follows_a_rigid_motion(camera: Camera, height_mm: float) -> None:
    """A turned sheet carries its dots along as a solid does: the middle surface lies above them."""
    patch = SplinePatch(size_mm=(40.0, 30.0), elements=(9, 7), boundary="soft")
    shell = Shell(patch=patch, thickness_mm=3.0)
    cos, sin = np.cos(0.2), np.sin(0.2)
    turn = np.array([[cos, 0.0, sin], [0.0, 1.0, 0.0], [-sin, 0.0, cos]])
    lift = 1.5 + height_mm  # of the middle surface over the dots
    middle = np.column_stack([patch.place_mm, np.full(patch.node_count, lift)])
    face = Face(shell=shell, point_mm=np.array([[4.0, 3.0], [-11.0, 2.0]]), height_mm=height_mm)
    rest = np.column_stack([face.point_mm, np.zeros(2)])
    np.testing.assert_allclose(face.displacement(middle @ turn.T - middle), rest @ turn.T - rest, atol=1e-12)


def test_the_camera_side_of_a_hollow_is_stretched() -> None:
    """Where the camera-side face bulges to the camera its points spread."""
    patch = SplinePatch(size_mm=(40.0, 30.0), elements=(9, 7), boundary="soft")
    shell = Shell(patch=patch, thickness_mm=3.0)
    bowl = np.zeros((patch.node_count, 3))
    bowl[:, 2] = 0.01 * (patch.place_mm**2).sum(axis=1)
    face = Face(shell=shell, point_mm=np.array([[-1.0, 0.0], [0.0, 0.0], [1.0, 0.0]]))
    moved = face.displacement(bowl)
    curvature = 0.02
    assert moved[2, 0] - moved[0, 0] == pytest.approx(2.0 * 1.5 * curvature, rel=0.03)
    middle_mm = reference.derivative(patch, bowl, np.zeros((1, 2)), 0, 0)[0, 2]
    assert moved[1, 2] == pytest.approx(middle_mm - 3.0**2 / 5.0 * 2.0 * curvature, abs=1e-6)


def test_a_stretched_sheet_is_thinner() -> None:
    patch = SplinePatch(size_mm=(40.0, 30.0), elements=(9, 7), boundary="soft")
    wide = np.zeros((patch.node_count, 3))
    wide[:, 0] = 0.01 * patch.place_mm[:, 0]
    face = Face(shell=Shell(patch=patch, thickness_mm=3.0), point_mm=np.array([[3.0, 2.0]]))
    moved = face.displacement(wide)[0]
    assert moved[2] == pytest.approx(1.5 * 0.45 / 0.55 * 0.01, rel=0.01)


def test_fibres_lean_where_the_curvature_varies() -> None:
    """b = k x^3 has grad lap b = 6 k along x: fibres at the origin, where b has no slope, have -6 k a / 6."""
    patch = SplinePatch(size_mm=(40.0, 30.0), elements=(9, 7), boundary="soft")
    k = 1e-5
    greville = np.unique(patch.place_mm[:, 0].round(9))
    along = reference.spline(40.0, 9)(greville + 20.0)
    found = np.linalg.solve(along, k * greville**3)
    cubic = np.zeros((patch.node_count, 3))
    cubic[:, 2] = found[np.searchsorted(greville, patch.place_mm[:, 0] - 1e-6)]
    for factor in (0.0, 0.2):
        shell = Shell(patch=patch, thickness_mm=3.0, shear_factor=factor)
        lean, _, sunk = Face(shell=shell, point_mm=np.array([[0.0, 0.0], [5.0, 0.0]])).displacement(cubic).T
        shear_mm2 = factor * 3.0**2
        assert lean[0] == pytest.approx(-1.5 * k * shear_mm2, abs=1e-9)
        assert sunk[1] == pytest.approx(k * (5.0**3 - shear_mm2 * 6.0 * 5.0), rel=0.01)


def face_reference_mm(face: Face, coefficient_mm: np.ndarray) -> np.ndarray:
    """`Face.displacement` by scipy: displacement of the middle surface minus levers times normal."""
    shell, patch, point_mm = face.shell, face.shell.patch, face.point_mm
    base = [reference.derivative(patch, coefficient_mm, point_mm, *way) for way in ((1, 0), (0, 1))]
    for axis, way in enumerate(((1, 0), (0, 1))):
        base[axis][:, axis] += 1.0
        turned = shell.shear_mm2 / 6.0 * reference.laplacian(patch, coefficient_mm, point_mm, *way)
        base[axis][:, 2] -= turned
    trace = 0.5 * ((base[0] ** 2).sum(axis=1) + (base[1] ** 2).sum(axis=1)) - 1.0
    thinner = 1.0 - shell.poisson / (1.0 - shell.poisson) * trace
    assert np.abs(thinner - 0.9).max() < 0.4  # bounds of the thickness
    half, nu = 0.5 * shell.thickness_mm, shell.poisson
    across = half * thinner + face.height_mm
    tension = trace / (2.0 * (1.0 - nu)) + shell.pretension_over_E_mm / shell.thickness_mm  # over E t
    in_plane = across + half * nu * (1.0 + nu) * tension
    normal = np.cross(base[0], base[1])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    at_rest = np.array([0.0, 0.0, 0.5 * shell.thickness_mm + face.height_mm])
    return (
        reference.moved(patch, coefficient_mm, point_mm)
        - np.column_stack([in_plane, in_plane, across]) * normal
        + at_rest
    )


def test_the_face_is_that_of_its_derivation(shell: Shell, bent_mm: np.ndarray, dots: MarkerImages) -> None:
    point_mm = np.ascontiguousarray(dots.rest_mm[:, :2])
    for height_mm in (0.0, 0.4):
        face = Face(shell=shell, point_mm=point_mm, height_mm=height_mm)
        np.testing.assert_allclose(
            face.displacement(0.3 * bent_mm), face_reference_mm(face, 0.3 * bent_mm), atol=1e-12
        )


def test_derivatives_of_the_face(shell: Shell, bent_mm: np.ndarray, dots: MarkerImages) -> None:
    face = Face(shell=shell, point_mm=np.ascontiguousarray(dots.rest_mm[:, :2]), height_mm=0.4)
    way = np.random.default_rng(3).normal(size=bent_mm.shape) * shell.patch.is_free
    expected = (face.displacement(bent_mm + H * way) - face.displacement(bent_mm - H * way)) / (2 * H)
    found = np.einsum("kinj,knj->ki", face.derivative(bent_mm), way[face.basis.node])
    np.testing.assert_allclose(found, expected, atol=1e-6)


def fine_centroid_px(dots: MarkerImages, coefficient_mm: np.ndarray, number: int) -> np.ndarray:
    """Image-area centroid of a dot from many small triangles of its disc."""
    angle = np.linspace(0.0, 2.0 * np.pi, 241)[:-1]
    ring = np.column_stack([np.cos(angle), np.sin(angle)]) * dots.radius_mm[number]
    place = dots.rest_mm[number, :2] + np.concatenate([ring, np.zeros((1, 2))])
    face = Face(shell=dots.shell, point_mm=place)
    point = np.column_stack([place, np.zeros(len(place))]) + face.displacement(coefficient_mm)
    pixel = project(dots.camera, point)
    a, b = pixel[:-1] - pixel[-1], np.roll(pixel[:-1], -1, axis=0) - pixel[-1]
    area = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return np.asarray(pixel[-1] + (area[:, None] * (a + b)).sum(axis=0) / (3.0 * area.sum()))


def test_the_prediction_is_the_centroid_of_the_disc_in_the_image(
    dots: MarkerImages, bent_mm: np.ndarray
) -> None:
    dots = replace(dots, shell=replace(dots.shell, shear_factor=0.0))  # fibres of a disc have one tilt
    rest = np.zeros_like(bent_mm)
    found, centre = dots.displacement_px(bent_mm), dots.displacement_mm(bent_mm)
    pixel = project(dots.camera, dots.rest_mm + centre) - project(dots.camera, dots.rest_mm)
    chosen = np.argsort(-np.linalg.norm(found - pixel, axis=1))[:6]
    expected = np.array(
        [fine_centroid_px(dots, bent_mm, i) - fine_centroid_px(dots, rest, i) for i in chosen]
    )
    wrong_without = np.linalg.norm(pixel[chosen] - expected, axis=1)
    wrong = np.linalg.norm(found[chosen] - expected, axis=1)
    assert (wrong < 0.15 * wrong_without).all()


def test_the_derivative_is_exact_for_points_and_close_for_discs(
    dots: MarkerImages, bent_mm: np.ndarray
) -> None:
    way = np.random.default_rng(3).normal(size=bent_mm.shape) * dots.shell.patch.is_free
    found = np.einsum("manj,mnj->ma", dots.derivative_px(bent_mm), way[dots.tips.basis.node])

    def numeric(seen: MarkerImages) -> np.ndarray:
        return (seen.displacement_px(bent_mm + H * way) - seen.displacement_px(bent_mm - H * way)) / (2 * H)

    points = replace(dots, radius_mm=dots.radius_mm * 1e-3)
    size = np.sqrt((found**2).mean())
    np.testing.assert_allclose(found, numeric(points), atol=1e-4 * size)
    assert np.sqrt(((found - numeric(dots)) ** 2).mean()) < 0.15 * size


def test_changed_markers_have_the_same_images_as_new_ones_and_share_outlines(
    dots: MarkerImages, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(3)
    shape_mm = rng.normal(scale=0.1, size=(dots.shell.patch.node_count, 3))
    taut = replace(dots.shell, pretension_over_E_mm=dots.shell.pretension_over_E_mm + 0.1)
    thicker = replace(dots.shell, thickness_mm=1.1 * dots.shell.thickness_mm)
    turned = replace(dots.camera, rotation_vector=np.array([0.1, 0.0, 0.0]))
    new = [replace(dots, **change) for change in ({"shell": taut}, {"shell": thicker}, {"camera": turned})]
    expected_px = [each.displacement_px(shape_mm) for each in new]
    computed = mock.Mock(side_effect=disc_places)
    monkeypatch.setattr("manytouch.mechanics.markers.images.disc_places", computed)
    changed = [dots.changed(shell=taut), dots.changed(shell=thicker), dots.changed(camera=turned)]
    for found, place_px in zip(changed, expected_px, strict=True):
        np.testing.assert_array_equal(found.displacement_px(shape_mm), place_px)
    assert computed.call_count == 2  # only a thicker sheet has other basis functions

"""Values anywhere on the camera-side face."""

import numpy as np

from manytouch.simulation.fem.elements.mesh import sheet_mesh
from manytouch.simulation.fem.elements.sampling import sample_camera_side

MESH = sheet_mesh((9.0, 6.5), 3.0, element_mm=2.0)


def test_a_quadratic_field_comes_back_with_its_gradient() -> None:
    def field(point: np.ndarray) -> np.ndarray:
        x, y, z = point.T
        return 1e-2 * np.column_stack([x * y + z, y**2 - z * x, x**2 - 0.5 * y + z**2])

    place = np.random.default_rng(0).uniform(-1.0, 1.0, (50, 2)) * [4.5, 3.25]
    point = np.column_stack([place, np.zeros(len(place))])
    displacement, gradient = sample_camera_side(MESH, field(MESH.node_mm), place)
    np.testing.assert_allclose(displacement, field(point), atol=1e-12)
    step = 1e-6
    for axis in range(3):
        shift = step * np.eye(3)[axis]
        slope = (field(point + shift) - field(point - shift)) / (2 * step)
        np.testing.assert_allclose(gradient[:, :, axis], np.eye(3)[axis] + slope, atol=1e-8)


def test_the_nodes_keep_their_values_up_to_the_outline() -> None:
    node = np.isclose(MESH.node_mm[:, 2], 0.0)
    nodal = np.random.default_rng(1).standard_normal(MESH.node_mm.shape)
    displacement, _ = sample_camera_side(MESH, nodal, np.ascontiguousarray(MESH.node_mm[node, :2]))
    np.testing.assert_allclose(displacement, nodal[node], atol=1e-12)


def test_outside_the_sheet_nothing_is_known() -> None:
    displacement, gradient = sample_camera_side(
        MESH, np.zeros_like(MESH.node_mm), np.array([[4.6, 0.0], [0.0, 0.0]])
    )
    assert np.isnan(displacement[0]).all()
    assert np.isnan(gradient[0]).all()
    np.testing.assert_array_equal(gradient[1], np.eye(3))

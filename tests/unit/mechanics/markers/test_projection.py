"""The compiled cameras against those of `manytouch.geometry.camera`."""

from dataclasses import replace

import numpy as np

from manytouch.geometry.camera import project
from manytouch.mechanics.markers import projection
from manytouch.values import Camera

H = 1e-4


def cameras(camera: Camera) -> list[Camera]:
    fisheye = replace(camera, model="fisheye", distortion=np.array([0.05, -0.02, 0.01, 0.003]))
    return [camera, fisheye]


def test_the_kernels_project_as_the_cameras_do(camera: Camera) -> None:
    point = np.random.default_rng(0).normal(size=(20, 3)) * [20.0, 15.0, 5.0]
    for each in cameras(camera):
        model = projection.camera_model(each)
        found = np.array([projection.pixel(model, *xyz) for xyz in point])
        np.testing.assert_allclose(found, project(each, point), atol=1e-9)


def test_the_slope_of_the_projection(camera: Camera) -> None:
    out = np.empty((2, 3))
    for each in cameras(camera):
        model = projection.camera_model(each)
        for xyz in np.random.default_rng(0).normal(size=(5, 3)) * [20.0, 15.0, 5.0]:
            projection.pixel_derivative(model, *xyz, out)
            expected = [
                (project(each, (xyz + h)[None]) - project(each, (xyz - h)[None]))[0] / (2 * H)
                for h in H * np.eye(3)
            ]
            np.testing.assert_allclose(out, np.transpose(expected), rtol=1e-6, atol=1e-6)

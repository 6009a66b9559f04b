"""Outlines of contacts in the present image."""

from dataclasses import replace

import numpy as np

from manytouch.geometry.camera import project
from manytouch.sinks.contact_outlines import outlines_px
from manytouch.values import OutlineRing

SQUARE = np.array([[-2.0, -2.0], [2.0, -2.0], [2.0, 2.0], [-2.0, 2.0]])


def test_outlines_lie_on_the_deformed_face(sensor, reading_of, contact_of):
    rings = (OutlineRing(point_mm=SQUARE), OutlineRing(point_mm=0.5 * SQUARE, is_hole=True))
    contacts = (contact_of(3, outline=rings), contact_of(4), contact_of(5, outline=rings[:1]))
    surface = replace(reading_of(depth_mm=2.0).surface, layout=sensor.layout)
    found = outlines_px(sensor, surface, contacts)
    assert {number: len(shown) for number, shown in found.items()} == {3: 2, 5: 1}
    moved = np.column_stack([SQUARE, np.zeros(4)]) + np.array([0.1, -0.2, -2.0])  # of `reading_of`
    np.testing.assert_allclose(found[3][0], project(sensor.camera, moved), atol=1e-6)
    np.testing.assert_array_equal(found[3][0], found[5][0])


def test_where_the_surface_is_unknown_the_face_at_rest_is_used(sensor, reading_of, contact_of):
    contact = contact_of(3, outline=(OutlineRing(point_mm=SQUARE),))
    surface = replace(reading_of(unseen=tuple(range(24))).surface, layout=sensor.layout)
    at_rest = project(sensor.camera, np.column_stack([SQUARE, np.zeros(4)]))
    np.testing.assert_allclose(outlines_px(sensor, surface, (contact,))[3][0], at_rest, atol=1e-6)
    assert outlines_px(sensor, surface, ()) == {}

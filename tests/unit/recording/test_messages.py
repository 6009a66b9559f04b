"""The readable part of a recorded reading: contacts in plain numbers, null where unknown."""

import json
from dataclasses import replace

import numpy as np
import pytest

from contacts import contact_with
from manytouch.errors import SourceError
from manytouch.recording.messages import READING_SCHEMA, decode_reading, encode_reading
from manytouch.sources.simulated import simulated_source
from manytouch.values import (
    Contacts,
    ContactShape,
    Detections,
    Interpolation,
    OutlineRing,
    Reading,
)

TRIANGLE_MM = np.array([[0.0, 0.0], [1.23456, 0.0], [0.0, 1.0]])


@pytest.fixture(scope="module")
def reading() -> Reading:
    source = simulated_source().lasting(0.1)
    truth = source.truth(0)
    return Reading(
        frame=next(iter(source)),
        detections=Detections(
            centre_px=np.zeros((0, 2)),
            covariance_px2=np.zeros((0, 2, 2)),
            area_px2=np.zeros(0),
            contrast=np.zeros(0),
        ),
        grid=truth.grid,
        surface=truth.surface,
        contacts=Contacts(
            contacts=(
                contact_with(),
                contact_with(
                    half_major_mm=2.0,
                    orientation_rad=0.25,
                    shape=ContactShape.PATCH,
                    shape_probability=0.9,
                    outline=(
                        OutlineRing(
                            point_mm=np.array([[0.0, 0.0], [1.23456, 0.0], [0.0, 1.0]]), is_hole=True
                        ),
                    ),
                ),
            )
        ),
        milliseconds=1.0,
    )


def test_regions_are_plain_numbers(reading: Reading) -> None:
    unknown, known = json.loads(encode_reading(reading))["contacts"]
    assert unknown["half_major_mm"] is unknown["shape"] is unknown["outline"] is None
    assert (known["half_major_mm"], known["half_minor_mm"]) == (2.0, None)
    assert (known["orientation_rad"], known["shape"], known["shape_probability"]) == (0.25, "patch", 0.9)
    (ring,) = known["outline"]
    assert ring == {"is_hole": True, "points_mm": [[0.0, 0.0], [1.235, 0.0], [0.0, 1.0]]}


def test_the_schema_names_every_field_of_a_contact(reading: Reading) -> None:
    named = READING_SCHEMA["properties"]["contacts"]["items"]["properties"]
    for found in json.loads(encode_reading(reading))["contacts"]:
        assert set(found) == set(named)


def test_a_surface_is_played_back_with_its_interpolation(reading: Reading) -> None:
    between = Interpolation(kind="idw", iterations=30, search_radius_pitch=2.0)
    message = encode_reading(replace(reading, surface=replace(reading.surface, interpolation=between)))
    layout = reading.surface.layout
    assert decode_reading(message, reading.frame, layout).surface.interpolation == between
    with pytest.raises(SourceError, match="from 2 to 300"):
        decode_reading(message.replace(b'"iterations":30', b'"iterations":9999'), reading.frame, layout)

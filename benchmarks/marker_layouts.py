"""Markers for `random_scenes.py --layouts` that are not a square lattice over the whole sheet.

Scene n has the arrangement n modulo 8 of `LAYOUTS`, and is the same on every machine.
"""

from copy import deepcopy
from typing import Any

import numpy as np

SEED = 70_000
LAYOUTS = ("hexagonal", "irregular", "margin", "close", "oval", "two-pitches", "standing", "coarse")
TRIES = 40_000

Part = dict[str, Any]


def with_layout(number: int, sensor: Part) -> Part:
    """The contents of a sensor file with its markers arranged otherwise, and with the name of the layout."""
    draw, layout = np.random.default_rng(SEED + number), LAYOUTS[number % len(LAYOUTS)]
    given = deepcopy(sensor)
    markers, size_mm = given["markers"], np.array(given["sheet"]["size_mm"])
    pitch_mm = float(markers["pitch_mm"])
    given["name"] = f"{layout}-{number}"
    match layout:
        case "hexagonal" | "irregular" | "oval":
            place_mm = _places(draw, layout, size_mm, pitch_mm)
            order = np.lexsort((place_mm[:, 0], np.round(place_mm[:, 1], 2)))
            for key in ("columns", "rows", "pitch_mm"):
                del markers[key]
            markers["rest_mm"] = np.round(place_mm[order], 4).tolist()
        case "margin":  # the outermost dots are two to four pitches from the clamp
            less = 2 * int(draw.integers(1, 4))
            markers["columns"] = max(markers["columns"] - less, 6)
            markers["rows"] = max(markers["rows"] - less, 5)
        case "close":  # they are half a pitch from it
            markers["columns"] += 1
            markers["rows"] += 1
            markers["radius_mm"] = min(markers["radius_mm"], 0.2 * pitch_mm)
        case "two-pitches":
            markers["pitch_mm"] = [1.35 * pitch_mm, pitch_mm]
            markers["columns"] = int(size_mm[0] / (1.35 * pitch_mm)) - 1
        case "standing":
            markers["height_mm"] = float(draw.uniform(0.3, 1.5))
        case _:
            count = np.maximum((size_mm / (1.6 * pitch_mm)).astype(int) - 1, [5, 4])
            markers["columns"], markers["rows"] = count.tolist()
            markers["pitch_mm"] = 1.6 * pitch_mm
            markers["radius_mm"] *= 1.2
    return given


def _places(draw: np.random.Generator, layout: str, size_mm: np.ndarray, pitch_mm: float) -> np.ndarray:
    """(m, 2) places of the markers."""
    if layout == "irregular":
        place_mm = np.zeros((0, 2))
        for _ in range(TRIES):
            tried_mm = draw.uniform(-0.5 * size_mm + 0.5 * pitch_mm, 0.5 * size_mm - 0.5 * pitch_mm)
            if np.all(np.linalg.norm(place_mm - tried_mm, axis=1) > 0.75 * pitch_mm):
                place_mm = np.vstack([place_mm, tried_mm])
        return place_mm
    if layout == "oval":
        count = (size_mm / pitch_mm).astype(int) + 2
        column, row = np.meshgrid(*(np.arange(n) - 0.5 * (n - 1) for n in count))
        place_mm = pitch_mm * np.stack([column, row], axis=-1).reshape(-1, 2)
        return np.asarray(place_mm[np.square(place_mm / (0.5 * size_mm - 0.6 * pitch_mm)).sum(axis=1) <= 1.0])
    column, row = np.meshgrid(np.arange(-60, 61), np.arange(-60, 61))
    across = np.stack([column + 0.5 * (row % 2), 0.5 * np.sqrt(3.0) * row], axis=-1)
    place_mm = 1.07 * pitch_mm * across.reshape(-1, 2)
    return np.asarray(place_mm[(np.abs(place_mm) <= 0.5 * size_mm - 0.6 * pitch_mm).all(axis=1)])

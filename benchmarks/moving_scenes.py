"""Bodies and sensor files for `random_scenes.py --moving`: bodies that move, sensor files with wrong numbers.

Scene n is the same on every machine, and so is its sensor file with errors.
"""

import math
from collections.abc import Callable
from copy import deepcopy
from functools import partial
from typing import Any

import numpy as np

SEED, DRAWN_SEED = 77_000, 9_000
PAD_SEED, DRAWN_PAD_SEED = 81_000, 9_500
SECONDS = 3.0
LEAST_SIDE_MM = 1.0
UNKNOWN_EVERY = 3
"""Every third sensor file with errors does not state the pretension."""


Part = dict[str, Any]


def _shape(draw: np.random.Generator) -> Part:
    """A ball, fingertip, punch or lying cylinder, of 2 to 14 mm."""
    size_mm = float(np.exp(draw.uniform(np.log(2.0), np.log(14.0))))
    shapes: tuple[Part, ...] = (
        {"kind": "sphere", "radius_mm": size_mm},
        {"kind": "fingertip", "semi_axes_mm": [size_mm * 0.8 + 2.0, size_mm + 3.0, size_mm * 0.8 + 2.0]},
        {"kind": "round_punch", "radius_mm": 0.6 * size_mm + 1.0},
        {"kind": "square_punch", "side_mm": [1.6 * size_mm, float(draw.uniform(0.4, 1.0)) * 1.6 * size_mm]},
        {
            "kind": "cylinder",
            "radius_mm": max(0.4 * size_mm, 1.5),
            "length_mm": float(draw.uniform(1.5, 4.0)) * size_mm,
        },
    )
    return shapes[int(draw.integers(5))]


def _long_shape(draw: np.random.Generator) -> Part:
    """In two of three cases a lying cylinder or a bar, 12 to 45 mm long, else a ball of 2 to 10 mm."""
    size_mm = float(np.exp(draw.uniform(np.log(2.0), np.log(10.0))))
    if draw.random() >= 0.65:
        return {"kind": "sphere", "radius_mm": size_mm}
    length_mm = float(draw.uniform(12.0, 45.0))
    if draw.random() < 0.6:
        return {"kind": "cylinder", "radius_mm": max(0.4 * size_mm, 1.5), "length_mm": length_mm}
    width_mm = max(0.15, float(draw.uniform(0.1, 0.4))) * length_mm
    return {"kind": "square_punch", "side_mm": [length_mm, width_mm]}


def _reach_mm(shape: Part) -> float:
    """How far a shape reaches from its middle, about."""
    match shape["kind"]:
        case "sphere":
            return float(0.5 * shape["radius_mm"])
        case "fingertip":
            return float(0.5 * max(shape["semi_axes_mm"]))
        case "round_punch":
            return float(shape["radius_mm"])
        case "square_punch":
            return 0.5 * math.hypot(*shape["side_mm"])
        case _:
            return float(0.5 * shape["length_mm"])


def moving_bodies(draw: np.random.Generator, sensor: Part, *, are_long: bool = False) -> list[Part]:
    """One to five bodies that press, slide, roll or turn, at least 2.5 thicknesses or 6 mm apart.

    `are_long`: cylinders and bars as `_long_shape` draws them, of which those that do not fit are left out.
    """
    size_mm, thickness_mm = np.array(sensor["sheet"]["size_mm"]), float(sensor["sheet"]["thickness_mm"])
    wanted = int(draw.choice([1, 2, 2, 3, 3, 4, 5]))
    return _placed(
        draw,
        wanted,
        tries=200,
        apart_mm=max(2.5 * thickness_mm, 6.0),
        shape_of=_long_shape if are_long else _shape,
        reach_of=_reach_mm,
        room_of=lambda reach_mm: 0.5 * size_mm - reach_mm - 2.5 * thickness_mm - 2.0,
        least_room_mm=1.0,
        motion_of=partial(_motion, sensor=sensor),
    )


def _placed(
    draw: np.random.Generator,
    wanted: int,
    *,
    tries: int,
    apart_mm: float,
    shape_of: Callable[[np.random.Generator], Part],
    reach_of: Callable[[Part], float],
    room_of: Callable[[float], np.ndarray],
    least_room_mm: float,
    motion_of: Callable[[np.random.Generator, Part, np.ndarray, np.ndarray], Part],
) -> list[Part]:
    """Bodies with a distance between them where they begin and where they slide to."""
    bodies: list[Part] = []
    places: list[tuple[np.ndarray, float]] = []
    for _ in range(tries):
        if len(bodies) == wanted:
            break
        shape = shape_of(draw)
        reach_mm = reach_of(shape)
        room_mm = room_of(reach_mm)
        if (room_mm < least_room_mm).any():
            continue
        at_mm = draw.uniform(-room_mm, room_mm)
        if _is_nearer(apart_mm, at_mm, reach_mm, places):
            continue
        motion = motion_of(draw, shape, at_mm, room_mm)
        if motion["kind"] == "slide" and _is_nearer(apart_mm, np.array(motion["to_mm"]), reach_mm, places):
            continue
        places.append((at_mm, reach_mm))
        friction = float(draw.choice([0.0, 0.3, 0.6, 1.0]))
        bodies.append({"shape": shape, "friction": friction, "motions": [motion]})
    return bodies


def _is_nearer(
    apart_mm: float, at_mm: np.ndarray, reach_mm: float, places: list[tuple[np.ndarray, float]]
) -> bool:
    """Whether less than a distance would be between a body at a place and others."""
    return any(np.linalg.norm(at_mm - place) < reach_mm + reach + apart_mm for place, reach in places)


def _motion(
    draw: np.random.Generator,
    shape: Part,
    at_mm: np.ndarray,
    room_mm: np.ndarray,
    sensor: Part,
) -> Part:
    """A motion within 2.9 s, .15 to 2.2 thicknesses deep."""
    size_mm, thickness_mm = np.array(sensor["sheet"]["size_mm"]), float(sensor["sheet"]["thickness_mm"])
    deepest_mm = min(2.2 * thickness_mm, 0.12 * float(size_mm.min()), 10.0)
    depth_mm = float(np.exp(draw.uniform(np.log(0.15 * thickness_mm), np.log(deepest_mm))))
    start_s = float(draw.uniform(0.2, 0.9))
    end_s = min(float(start_s + draw.uniform(1.2, 1.9)), 2.9)
    may_roll = shape["kind"] in {"sphere", "fingertip"}
    kind = str(draw.choice(["press", "press", "slide", "path", "roll" if may_roll else "press"]))
    ramp_s = float(draw.uniform(0.2, 0.5))
    motion: Part = {"kind": kind, "depth_mm": depth_mm, "start_s": start_s, "end_s": end_s}
    if kind != "path":
        return {
            **motion,
            **_simple(draw, kind, at_mm, room_mm, ramp_s=ramp_s, way_mm=12.0, roll_deg=(20.0, 60.0)),
        }
    angle_deg = float(draw.uniform(-90.0, 90.0))
    turned_deg = angle_deg + float(draw.choice([0.0, draw.uniform(-30.0, 30.0)]))
    times_s = (start_s, start_s + 0.4, start_s + 0.8, end_s - 0.2, end_s)
    depths_mm = (-0.5, 0.6 * depth_mm, depth_mm, depth_mm, -0.5)
    angles_deg = (angle_deg, angle_deg, angle_deg, turned_deg, turned_deg)
    return {
        "kind": kind,
        "points": [
            [at_s, *at_mm.tolist(), deep_mm] for at_s, deep_mm in zip(times_s, depths_mm, strict=True)
        ],
        "turns_deg": [[0.0, 0.0, each_deg] for each_deg in angles_deg],
    }


def _simple(
    draw: np.random.Generator,
    kind: str,
    at_mm: np.ndarray,
    room_mm: np.ndarray,
    *,
    ramp_s: float,
    way_mm: float,
    roll_deg: tuple[float, float],
) -> Part:
    """A press, a slide or a roll without its depth and its times."""
    if kind == "press":
        return {"at_mm": at_mm.tolist(), "ramp_s": ramp_s}
    if kind == "slide":
        to_mm = np.clip(at_mm + draw.uniform(-way_mm, way_mm, 2), -room_mm, room_mm)
        return {"from_mm": at_mm.tolist(), "to_mm": to_mm.tolist(), "ramp_s": ramp_s}
    direction_deg, angle_deg = float(draw.uniform(-180.0, 180.0)), float(draw.uniform(*roll_deg))
    return {"at_mm": at_mm.tolist(), "direction_deg": direction_deg, "angle_deg": angle_deg}


def sensor_with_errors(number: int, sensor: Part) -> Part:
    """The sensor file with the errors of a careful user.

    Their standard deviations are those of the group `drawn`: thickness 5 %, E 8 %, pretension 20 % or not
    stated, each side of the outline 0.3 mm, pose 0.2 degrees, focal length 0.3 %, Poisson's ratio 0.02.
    """
    off = np.random.default_rng(DRAWN_SEED + number).standard_normal(12).clip(-2.5, 2.5).tolist()
    given = deepcopy(sensor)
    sheet, camera = given["sheet"], given["camera"]
    focal = 1.0 + 0.003 * off[0]
    camera["fx_px"] *= focal
    camera["fy_px"] *= focal
    camera["pose"]["translation_mm"][2] *= focal
    camera["pose"]["rotation_vector"] = (np.deg2rad(0.2) * np.array(off[1:4])).tolist()
    sides_mm = 0.3 * np.array([off[4] + off[5], off[6] + off[7]])
    sheet["size_mm"] = (np.array(sheet["size_mm"]) + sides_mm).tolist()
    sheet["thickness_mm"] *= 1.0 + 0.05 * off[8]
    sheet["young_MPa"] *= 1.0 + 0.08 * off[9]
    sheet["poisson"] = min(sheet["poisson"] + 0.02 * off[10], 0.495)
    if number % UNKNOWN_EVERY == 0:
        del sheet["pretension_N_per_mm"]
    else:
        sheet["pretension_N_per_mm"] *= 1.0 + 0.2 * off[11]
    return given


def _pad_shape(draw: np.random.Generator) -> Part:
    """A ball, fingertip, punch or lying cylinder, of 1.5 to 6 mm."""
    size_mm = float(np.exp(draw.uniform(np.log(1.5), np.log(6.0))))
    narrow_mm = max(float(draw.uniform(0.4, 1.0)) * size_mm, LEAST_SIDE_MM)
    long_mm = float(draw.uniform(1.0, 2.5)) * size_mm
    shapes: tuple[Part, ...] = (
        {"kind": "sphere", "radius_mm": size_mm},
        {"kind": "fingertip", "semi_axes_mm": [size_mm * 0.8 + 1.0, size_mm + 2.0, size_mm * 0.8 + 1.0]},
        {"kind": "round_punch", "radius_mm": 0.4 * size_mm + 0.5},
        {"kind": "square_punch", "side_mm": [size_mm, narrow_mm]},
        {"kind": "cylinder", "radius_mm": max(0.4 * size_mm, 0.8), "length_mm": long_mm},
    )
    return shapes[int(draw.integers(5))]


def moving_pad_bodies(draw: np.random.Generator, sensor: Part) -> list[Part]:
    """One to three bodies on a pad, .01 to .28 thicknesses deep, at least 1.2 thicknesses apart."""
    size_mm, thickness_mm = np.array(sensor["sheet"]["size_mm"]), float(sensor["sheet"]["thickness_mm"])
    wanted = int(draw.choice([1, 1, 2, 2, 3]))
    return _placed(
        draw,
        wanted,
        tries=100,
        apart_mm=1.2 * thickness_mm,
        shape_of=_pad_shape,
        reach_of=lambda shape: min(_reach_mm(shape), 0.4 * float(size_mm.min())),
        room_of=lambda reach_mm: 0.5 * size_mm - reach_mm - 0.6 * thickness_mm - 0.5,
        least_room_mm=0.5,
        motion_of=partial(_pad_motion, thickness_mm=thickness_mm),
    )


def _pad_motion(
    draw: np.random.Generator, shape: Part, at_mm: np.ndarray, room_mm: np.ndarray, thickness_mm: float
) -> Part:
    """A motion within 2.3 s."""
    depth_mm = float(np.exp(draw.uniform(np.log(0.02 * thickness_mm), np.log(0.28 * thickness_mm))))
    depth_mm *= 0.5 if "punch" in shape["kind"] else 1.0
    start_s = float(draw.uniform(0.2, 0.9))
    end_s = min(start_s + float(draw.uniform(1.0, 1.6)), 2.3)
    ramp_s = float(draw.uniform(0.2, 0.4))
    may_roll = shape["kind"] in {"sphere", "fingertip"}
    kind = str(draw.choice(["press", "press", "slide", "path", "roll" if may_roll else "path"]))
    motion: Part = {"kind": kind, "depth_mm": depth_mm, "start_s": start_s, "end_s": end_s}
    if kind != "path":
        return {
            **motion,
            **_simple(draw, kind, at_mm, room_mm, ramp_s=ramp_s, way_mm=4.0, roll_deg=(10.0, 40.0)),
        }
    angle_deg = float(draw.uniform(-90.0, 90.0))
    turned_deg = angle_deg + float(draw.choice([0.0, draw.uniform(-20.0, 20.0)]))
    dragged_mm = at_mm + draw.uniform(-0.1, 0.1, 2) * thickness_mm
    times_s = (start_s, start_s + 0.3, start_s + 0.6, end_s - 0.2, end_s)
    places_mm = (at_mm, at_mm, at_mm, dragged_mm, dragged_mm)
    depths_mm = (-0.1, 0.6 * depth_mm, depth_mm, depth_mm, -0.1)
    angles_deg = (angle_deg, angle_deg, angle_deg, turned_deg, turned_deg)
    return {
        "kind": kind,
        "points": [
            [at_s, *place_mm.tolist(), deep_mm]
            for at_s, place_mm, deep_mm in zip(times_s, places_mm, depths_mm, strict=True)
        ],
        "turns_deg": [[0.0, 0.0, each_deg] for each_deg in angles_deg],
    }


def pad_sensor_with_errors(number: int, sensor: Part) -> Part:
    """The file of a pad with the errors of a careful user, and their standard deviations.

    Those are E 8 %, thickness 5 %, Poisson's ratio 0.01 and depth of the markers 0.05 mm.
    """
    off = np.random.default_rng(DRAWN_PAD_SEED + number).standard_normal(6).clip(-2.5, 2.5).tolist()
    given = deepcopy(sensor)
    sheet = given["sheet"]
    sheet["young_std_MPa"], sheet["young_MPa"] = (
        0.08 * sheet["young_MPa"],
        sheet["young_MPa"] * math.exp(0.08 * off[0]),
    )
    sheet["thickness_std_mm"], sheet["thickness_mm"] = (
        0.05 * sheet["thickness_mm"],
        sheet["thickness_mm"] * (1.0 + 0.05 * off[1]),
    )
    sheet["poisson"], sheet["poisson_std"] = min(sheet["poisson"] + 0.01 * off[2], 0.495), 0.01
    sheet["marker_depth_mm"] = max(sheet["marker_depth_mm"] + 0.05 * off[3], 0.05)
    sheet["marker_depth_std_mm"] = 0.05
    return given

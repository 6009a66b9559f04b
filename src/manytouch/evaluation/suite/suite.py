"""The cases of the accuracy suite: nominal, separation, stress; see also `varied` and `pads`.

They are drawn from fixed seeds, so every run has the same ones. Every second case of a group is not
to be looked at while a method is tuned; its figures stand apart in the report.
"""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import product

import numpy as np

from manytouch.evaluation.evaluated_recordings.evaluated_recording import EvaluationError
from manytouch.evaluation.suite.cases import (
    GROUPS,
    OWN_PAD_GROUPS,
    VARIED_GROUPS,
    Case,
    SensorPerturbation,
    Touch,
)
from manytouch.evaluation.suite.pads.calculix import calculix_pads
from manytouch.evaluation.suite.pads.cases import pads
from manytouch.evaluation.suite.varied.cases import varied

SHEETS_MM = ((120.0, 80.0), (160.0, 100.0), (70.0, 70.0))
APART_MM = 13.0
FROM_CLAMP_MM = 13.0
DEEPEST_MM = (0.3, 0.6, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0)
DISTANCES_MM = (4.0, 6.0, 8.0, 10.0, 12.0, 14.0, 16.0, 20.0, 24.0, 28.0, 32.0, 40.0)
# numbers of the cases of the short run within their groups, from both halves
QUICK = {"nominal": {3, 6, 9, 19, 40}, "separation": {16, 27, 33, 46}, "stress": {5, 10, 14}}


def cases(groups: Sequence[str] = GROUPS, *, quick: bool = False, tuning: bool = False) -> tuple[Case, ...]:
    """The cases of some groups.

    Args:
        groups: of `GROUPS`.
        quick: only those of the short run.
        tuning: only those that may be looked at while a method is tuned.

    Raises:
        EvaluationError: there is no such group, or nothing is left.
    """
    for group in groups:
        if group not in GROUPS:
            raise EvaluationError(f"there is no group {group!r} of cases; there are: {', '.join(GROUPS)}")
    every: dict[str, Callable[[], Iterator[Case]]] = {
        "nominal": nominal,
        "separation": separation,
        "stress": stress,
        **{name: partial(varied, name) for name in VARIED_GROUPS},
        **{name: partial(pads, name) for name in OWN_PAD_GROUPS},
        "pads_calculix": calculix_pads,
    }
    found = tuple(
        case
        for group in groups
        for case in every[group]()
        if (case.is_quick or not quick) and (case.looked_at or not tuning)
    )
    if not found:
        raise EvaluationError("no case is left; name at least one group")
    return found


def nominal() -> Iterator[Case]:
    """1 to 6 contacts at least 13 mm apart, 0.3 to 10 mm deep, three sheets, pitch 4 mm, noise 2.5."""
    for number, (size_mm, deepest_mm) in enumerate(product(SHEETS_MM, DEEPEST_MM)):
        touches = 1 + (5 * number + number // 6) % 6
        yield Case(
            group="nominal",
            name=f"{size_mm[0]:g}x{size_mm[1]:g}-{deepest_mm}mm-{touches}",
            seed=1000 + number,
            looked_at=(number + number // len(DEEPEST_MM)) % 2 == 0,
            is_quick=number in QUICK["nominal"],
            touches=strewn(size_mm, touches, deepest_mm, 1000 + number),
            deepest_mm=deepest_mm,
            size_mm=size_mm,
        )


def separation() -> Iterator[Case]:
    """Two contacts 4 to 40 mm apart, of equal force and of 1 to 0.3, along x and aslant."""
    for number, (distance_mm, ratio, way) in enumerate(
        product(DISTANCES_MM, (1.0, 0.3), ("along", "aslant"))
    ):
        angle = 0.0 if way == "along" else np.deg2rad(35.0)
        half = 0.5 * distance_mm * np.array([np.cos(angle), np.sin(angle)])
        middle = np.random.default_rng(2000 + number).uniform(-3, 3, 2)
        ends = (middle - half, middle + half)
        yield Case(
            group="separation",
            name=f"{distance_mm:g}mm-1to{ratio:g}-{way}",
            seed=2000 + number,
            looked_at=(number // 4 + number) % 2 == 0,
            is_quick=number in QUICK["separation"],
            touches=tuple(
                Touch(at_mm=(round(float(x), 3), round(float(y), 3)), radius_mm=2.0, strength=strength)
                for (x, y), strength in zip(ends, (1.0, ratio), strict=True)
            ),
            strength_is="force",
            deepest_mm=3.0,
        )


def stress() -> Iterator[Case]:
    """What goes wrong in practice, two cases of each, one of them not to be looked at."""
    wrongs: dict[str, dict[str, object]] = {
        **{f"pitch-{pitch:g}mm": {"pitch_mm": pitch} for pitch in (3.0, 5.0, 6.0, 8.0)},
        **{f"noise-{noise:g}": {"noise": noise} for noise in (5.0, 10.0)},
        **{f"missing-{percent}": {"missing_share": percent / 100} for percent in (5, 15)},
        "thick-given-10-more": {"perturbation": SensorPerturbation(thickness_factor=1.1)},
        "thick-given-10-less": {"perturbation": SensorPerturbation(thickness_factor=0.9)},
        "stiff-given-20-more": {"perturbation": SensorPerturbation(young_factor=1.2)},
        "focal-given-1-more": {"perturbation": SensorPerturbation(focal_factor=1.01)},
        "centre-given-5px-off": {"perturbation": SensorPerturbation(centre_off_px=5.0)},
        "lens-not-known": {"perturbation": SensorPerturbation(is_lens_known=False)},
        **{f"friction-{friction:g}": {"friction": friction} for friction in (0.3, 0.6)},
        **{f"contacts-{contacts}": {"contacts": contacts} for contacts in (7, 8)},
    }
    for number, ((name, wrong), variant) in enumerate(product(wrongs.items(), "ab")):
        seed = 3000 + number
        contacts = wrong.get("contacts", 3)
        deepest_mm = float(np.round(np.random.default_rng(seed).uniform(1.5, 6.0), 1))
        yield Case(
            group="stress",
            name=f"{name}-{variant}",
            seed=seed,
            looked_at=variant == "a",
            is_quick=number in QUICK["stress"],
            touches=strewn((120.0, 80.0), int(str(contacts)), deepest_mm, seed),
            deepest_mm=deepest_mm,
            **{key: value for key, value in wrong.items() if key != "contacts"},  # type: ignore[arg-type]
        )


def strewn(size_mm: tuple[float, float], touches: int, deepest_mm: float, seed: int) -> tuple[Touch, ...]:
    """Touches at random places, `APART_MM` apart and `FROM_CLAMP_MM` from the clamp; the first is deepest."""
    chance = np.random.default_rng(seed)
    room = 0.5 * np.array(size_mm) - FROM_CLAMP_MM
    places: list[np.ndarray] = []
    while len(places) < touches:
        place = np.round(chance.uniform(-room, room), 2)
        if all(np.linalg.norm(place - other) >= APART_MM for other in places):
            places.append(place)
        elif chance.random() < 0.002:  # the places chosen so far leave no room
            places.clear()
    shares = [1.0, *np.round(chance.uniform(0.5, 1.0, touches - 1), 2).tolist()]
    return tuple(
        Touch(
            at_mm=(float(place[0]), float(place[1])),
            radius_mm=round(float(chance.uniform(3.0, 7.0)), 2),
            strength=round(deepest_mm * share, 3),
        )
        for place, share in zip(places, shares, strict=True)
    )

"""What a case of the accuracy suite is, in plain numbers, independent of the simulation."""

from dataclasses import dataclass
from typing import Literal

REST_FRAMES, RAMP_FRAMES, HOLD_FRAMES = 15, 8, 4
GROUPS = (
    *("nominal", "separation", "stress", "varied", "drawn", "calibrated"),
    *("pads", "pads_nominal", "pads_calibrated", "pads_calculix"),
)
VARIED_GROUPS = ("varied", "drawn", "calibrated")
"""Other shapes on other sheets: with the true sensor, with randomly sampled errors of its numbers, and with a
sensor that was calibrated from such errors."""
OWN_PAD_GROUPS = ("pads", "pads_nominal", "pads_calibrated")
"""Bonded pads solved by our own finite elements: with the true sensor file, with a nominal one, and with a
sensor that was calibrated from a nominal one."""
PAD_GROUPS = (*OWN_PAD_GROUPS, "pads_calculix")
"""Bonded pads, whose figures stand apart: also those that CalculiX solved, with the true sensor file."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Touch:
    """One ball.

    Attributes:
        at_mm: x, y of its middle.
        radius_mm: of the ball.
        strength: at the end of the ramp; see `Case.strength_is`.
    """

    at_mm: tuple[float, float]
    radius_mm: float
    strength: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorPerturbation:
    """Difference of the sensor given to the methods from the true one, as factors and offsets.

    Attributes:
        thickness_factor, young_factor, focal_factor: given over true.
        centre_off_px: of the optical centre, along x and y, at 2560 px width.
        is_lens_known: if not, a lens without distortion is given.
    """

    thickness_factor: float = 1.0
    young_factor: float = 1.0
    focal_factor: float = 1.0
    centre_off_px: float = 0.0
    is_lens_known: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One recording to be made and read: 15 frames at rest, 8 of growing pressure, 4 held.

    Attributes:
        group: one of `GROUPS`; "published" are the paper's presses, which belong to no group of the suite.
        name: within the group.
        seed: of the image noise and of what is missing.
        looked_at: may it be looked at while a method is tuned? Half of each group may not.
        is_quick: does it belong to the short run?
        touches: what presses.
        strength_is: "depth": of the ball's lowest point, mm; "force": in shares of the strongest, whose
            ball is `deepest_mm` deep.
        deepest_mm: of the deepest ball. The camera-side face is shallower by as much as the solid is
            pressed together.
        size_mm, thickness_mm, young_MPa, poisson, pretension_N_per_mm: of the clamped sheet.
        pitch_mm: of the dots, whose radius is a quarter of it.
        missing_share: of the dots that were not printed, which no method is given.
        noise: standard deviation of a pixel in grey levels of 255.
        friction: Coulomb's coefficient; the balls are dragged along the sheet until they slip.
        perturbation: of the sensor that is given to the methods.
        width_px: of the 16:9 picture.
    """

    group: Literal[
        "nominal",
        "separation",
        "stress",
        "varied",
        "drawn",
        "calibrated",
        "pads",
        "pads_nominal",
        "pads_calibrated",
        "pads_calculix",
        "published",
    ]
    name: str
    seed: int
    looked_at: bool
    is_quick: bool = False
    touches: tuple[Touch, ...]
    strength_is: Literal["depth", "force"] = "depth"
    deepest_mm: float
    size_mm: tuple[float, float] = (120.0, 80.0)
    thickness_mm: float = 3.0
    young_MPa: float = 3.1
    poisson: float = 0.45
    pretension_N_per_mm: float = 0.4
    pitch_mm: float = 4.0
    missing_share: float = 0.0
    noise: float = 2.5
    friction: float = 0.0
    perturbation: SensorPerturbation = SensorPerturbation()
    width_px: int = 2560

    @property
    def title(self) -> str:
        """Group and name."""
        return f"{self.group}/{self.name}"

    @property
    def frame_count(self) -> int:
        """Frames of its recording."""
        return REST_FRAMES + RAMP_FRAMES + HOLD_FRAMES


def pressure_share(frame: int) -> float:
    """How far the pressure has grown in a frame, 0 to 1."""
    share = min(max((frame - REST_FRAMES + 1) / RAMP_FRAMES, 0.0), 1.0)
    return share * share * (3 - 2 * share)

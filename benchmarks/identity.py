"""Identities of markers: detection and tracking compared with known truth.

    python benchmarks/identity.py [--markers 100000] [--only WORD] [--no-pictures] [--out DIR]

Two tables. From points: tracking alone gets the true dots with noise, at least `--markers` of them in each
condition; where it requires windows it gets only what lies in them. From pictures: detection and tracking
together, on drawn frames. All numbers are counted against truth:

wrong    markers that are `seen` where they are not: on another marker's dot or on a false dot,
         per 100 000 seen; (ok): of them, in frames whose status is "ok"
near     `seen` on a false dot within a quarter of a pitch of a dot that does not show: only its appearance
         differs; per 100 000 seen, not counted as wrong
lost     per cent of the dots that show but are not `seen`, without faults and the two frames after them
relock   clear frames after a fault until 99 % are seen and none is wrong, worst case (1: the first one)
"""

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree
from sequences import Course, FoldError, Sequence, can_move, course_of, dots_in, pictures

from manytouch.detection import DotSearch
from manytouch.pipeline import Detector, Pipeline, Tracker
from manytouch.tracking.tracker import MarkerTracker
from manytouch.values import Contacts, Detections, Frame, Reading, Sensor, Surface, TrackedGrid

GATE_PITCHES = 0.1
NEAR_PITCHES = 0.25
LOCKED = 0.99
CLEAR_FRAMES = 2
SEEDS_PER_RUN = 4  # at most
GOALS = {
    "wrong per 100 000": "0 (aim: 0 in 10^6)",
    "lost %": "0.5 to 1.2 pitches, 3 at 2.0 (aim: 0.1)",
    "relock": "2 frames",
    "rms at noise 2.5 / 10": ".015 / .04 px (aim: .010)",
}


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class NoEstimate:
    """Stands in for the estimation, which comes after identities."""

    def start(self, sensor: Sensor) -> Surface:
        """A surface of which nothing is known."""
        unknown = np.full(sensor.layout.rest_mm.shape, np.nan)
        covariance_mm2 = np.full((len(unknown), 3, 3), np.nan)
        return Surface(position_mm=unknown, displacement_mm=unknown, covariance_mm2=covariance_mm2)

    def step(self, state: Surface, grid: TrackedGrid) -> tuple[Surface, Surface, Contacts]:
        """The same again."""
        return state, state, Contacts(status=grid.status)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class GivenDots:
    """A detection of given dots: all of them, or those in windows around expected positions.

    Attributes:
        dots: of each frame.
        reach_px: half the width of a window; of several dots in one the nearest is found.
    """

    dots: tuple[Detections, ...]
    reach_px: float

    def start(self, sensor: Sensor) -> None:
        """Nothing to keep."""

    def step(self, state: None, frame: Frame, expected_px: np.ndarray | None) -> tuple[None, Detections]:
        """Dots of a frame by its index."""
        every = self.dots[frame.index]
        if expected_px is None or len(every.centre_px) == 0:
            return state, every
        near_px = expected_px[np.isfinite(expected_px).all(axis=1)]
        distance, nearest = cKDTree(every.centre_px).query(near_px, distance_upper_bound=self.reach_px)
        inside = np.unique(nearest[np.isfinite(distance)])
        return state, Detections(
            centre_px=every.centre_px[inside],
            covariance_px2=every.covariance_px2[inside],
            area_px2=every.area_px2[inside],
            contrast=every.contrast[inside],
            status=every.status,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """Result of one condition; the columns are explained at the top of the module.

    Attributes:
        wrong_ok: wrong in frames of status ok.
        wrong_flagged: wrong in frames with another status.
        rms_px: root mean square error of a centre along one axis.
        chi2: mean of squared error against predicted variance, 1 is right.
        ms: median time of a frame, generation not counted.
    """

    seen: int
    wrong_ok: int
    wrong_flagged: int
    near: int
    lost_percent: float
    relock: int | None
    rms_px: float
    chi2: float
    ms: float

    @property
    def wrong(self) -> float:
        """Per 100 000 seen."""
        return 1e5 * (self.wrong_ok + self.wrong_flagged) / max(self.seen, 1)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class FrameScore:
    """Comparison of one frame with the truth: masks (m,), and errors of the right markers (k, 2)."""

    is_wrong: np.ndarray
    is_near: np.ndarray
    is_lost: np.ndarray
    error_px: np.ndarray
    covariance_px2: np.ndarray


def score_frame(course: Course, index: int, grid: TrackedGrid) -> FrameScore:
    """Compare one frame: a marker is right where it is at its own dot, and that dot shows."""
    true_px, visible = course.centre_px[index], course.is_visible[index]
    with np.errstate(invalid="ignore"):
        away_px = np.linalg.norm(grid.position_px - true_px, axis=1)
    right = grid.is_seen & visible & (away_px < GATE_PITCHES * course.pitch_px)
    near = grid.is_seen & ~visible & (away_px < NEAR_PITCHES * course.pitch_px)
    if near.any() and visible.any():
        # A marker at another dot has a wrong identity all the same.
        to_dot_px, _ = cKDTree(true_px[visible]).query(grid.position_px[near])
        near[near] = to_dot_px > GATE_PITCHES * course.pitch_px
    return FrameScore(
        is_wrong=grid.is_seen & ~right & ~near,
        is_near=near,
        is_lost=visible & ~grid.is_seen,
        error_px=grid.position_px[right] - true_px[right],
        covariance_px2=grid.covariance_px2[right],
    )


def score(course: Course, readings: Iterator[Reading]) -> Score:
    """Compare all frames of a course with the truth."""
    is_skipped = _skipped_frames(course)
    seen = near = lost = visible = 0
    wrong = {True: 0, False: 0}
    errors, squares, spent_ms, is_locked = [], [], [], []
    for reading in readings:
        index, grid = reading.frame.index, reading.grid
        result = score_frame(course, index, grid)
        seen += int(grid.is_seen.sum())
        near += int(result.is_near.sum())
        wrong[reading.status == "ok"] += int(result.is_wrong.sum())
        shown = int(course.is_visible[index].sum())
        if not is_skipped[index]:
            visible += shown
            lost += int(result.is_lost.sum())
        if not course.is_faulty[index]:
            errors.append(result.error_px)
            inverse = np.linalg.inv(result.covariance_px2)
            squares.append(np.einsum("ni,nij,nj->n", result.error_px, inverse, result.error_px))
        is_locked.append(not result.is_wrong.any() and result.is_lost.sum() <= (1 - LOCKED) * shown)
        spent_ms.append(reading.milliseconds)
    error = np.concatenate(errors)
    return Score(
        seen=seen,
        wrong_ok=wrong[True],
        wrong_flagged=wrong[False],
        near=near,
        lost_percent=100.0 * lost / max(visible, 1),
        relock=_relock(course, np.array(is_locked)),
        rms_px=float(np.sqrt(np.mean(error**2))) if len(error) else float("nan"),
        chi2=float(np.mean(np.concatenate(squares)) / 2) if len(error) else float("nan"),
        ms=float(np.median(spent_ms)),
    )


def _skipped_frames(course: Course) -> np.ndarray:
    """(f,) frames of a fault, and those after it in which markers may still be found again."""
    is_skipped = course.is_faulty.copy()
    for _ in range(CLEAR_FRAMES - 1):
        is_skipped[1:] |= is_skipped[:-1].copy()
    return is_skipped


def _relock(course: Course, is_locked: np.ndarray) -> int | None:
    """Clear frames from the end of a fault, or from a jump of the view, until all is locked; worst case."""
    ends = np.flatnonzero(np.diff(course.is_faulty.astype(int)) < 0) + 1
    starts = np.concatenate([ends, np.flatnonzero(course.is_jump)])
    if len(starts) == 0:
        return None
    longest = 0
    for start in starts:
        after = np.flatnonzero(is_locked[start:])
        longest = max(longest, int(after[0]) + 1 if len(after) else len(is_locked) - int(start) + 1)
    return longest


def track_points(course: Course, track: Tracker, *, noise_px: float = 0.015) -> Iterator[Reading]:
    """Readings of tracking alone."""
    frames = range(course.sequence.frames)
    dots = tuple(dots_in(course, index, noise_px=noise_px) for index in frames)
    detect = GivenDots(dots=dots, reach_px=1.5 * course.radius_px)
    blank = (Frame(index=index, timestamp_ns=0, camera="points", image=None) for index in frames)
    return Pipeline(detect=detect, track=track, estimate=NoEstimate()).run(blank, course.sensor)


def track_pictures(course: Course, detect: Detector, track: Tracker) -> Iterator[Reading]:
    """Readings of detection and tracking."""
    return Pipeline(detect=detect, track=track, estimate=NoEstimate()).run(pictures(course), course.sensor)


def conditions() -> dict[str, Sequence]:
    """The conditions of tracking from points, by name."""
    conditions_by_name: dict[str, Sequence] = {}
    for step in (0.25, 0.5, 0.8, 1.2, 2.0):
        for missing in (0.0, 0.02, 0.05):
            conditions_by_name[f"step {step:g}, missing {100 * missing:g} %"] = Sequence(
                step_pitches=step, missing_share=missing, false_share=0.02
            )
    for step in (0.25, 0.8, 1.2, 2.0):
        conditions_by_name[f"step {step:g}, hole of 3"] = Sequence(
            step_pitches=step, hole_pitches=3.0, false_share=0.02
        )
    for step in (0.25, 0.8):
        conditions_by_name[f"step {step:g}, half hidden in turn"] = Sequence(
            step_pitches=step, hidden_share=0.5, false_share=0.02
        )
    for step in (0.5, 1.2):
        conditions_by_name[f"step {step:g}, free rim"] = Sequence(
            step_pitches=step, false_share=0.02, is_clamped=False
        )
    for shift in (0.6, 1.0):
        for step in (0.25, 0.8):
            conditions_by_name[f"view shifted {shift:g}, step {step:g}"] = Sequence(
                step_pitches=step, shift_pitches=shift, false_share=0.02, missing_share=0.02
            )
        conditions_by_name[f"view shifted {shift:g}, free rim"] = Sequence(
            shift_pitches=shift, false_share=0.02, is_clamped=False
        )
        conditions_by_name[f"view shifted {shift:g}, no rim"] = Sequence(shift_pitches=shift, margin=1.15)
        conditions_by_name[f"view shifted {shift:g}, no rim, even"] = Sequence(
            shift_pitches=shift, margin=1.15, jitter_pitches=0.0
        )
        conditions_by_name[f"view shifted {shift:g}, no rim, even, all alike"] = Sequence(
            shift_pitches=shift, margin=1.15, jitter_pitches=0.0, radius_spread=0.0, contrast_spread=0.0
        )
    for fault in ("black", "blurred", "saturated", "hidden", "flash"):
        conditions_by_name[f"{fault}, step 0.25"] = Sequence(fault=fault, false_share=0.02)
        conditions_by_name[f"{fault}, step 0.8"] = Sequence(fault=fault, step_pitches=0.8, false_share=0.02)
    for dots in (96, 384, 4000, 10000):
        conditions_by_name[f"{dots} dots, step 0.25"] = Sequence(
            dots=dots, false_share=0.02, missing_share=0.02
        )
        if dots > 96:
            conditions_by_name[f"{dots} dots, step 0.8"] = Sequence(
                dots=dots, step_pitches=0.8, false_share=0.02
            )
    return conditions_by_name


def picture_conditions() -> dict[str, Sequence]:
    """The conditions on drawn frames."""
    brief = Sequence(frames=20)
    conditions_by_name = {
        f"noise {noise:g}, step {step:g}": replace(brief, noise=noise, step_pitches=step)
        for noise in (2.5, 10.0)
        for step in (0.25, 0.8)
    }
    for noise in (2.5, 10.0):
        conditions_by_name[f"even noise {noise:g}, step 0.25"] = replace(
            brief, noise=noise, light_noise=0.0, frames=10
        )
    small = replace(brief, size="720p", frames=36)
    conditions_by_name["720p, step 1.2"] = replace(small, step_pitches=1.2)
    conditions_by_name["720p, step 0.8, 5 % missing, 2 % false"] = replace(
        small, step_pitches=0.8, missing_share=0.05, false_share=0.02
    )
    conditions_by_name["720p, hole of 3"] = replace(small, step_pitches=0.5, hole_pitches=3.0)
    for shift in (0.6, 1.0):
        conditions_by_name[f"720p, view shifted {shift:g}"] = replace(small, shift_pitches=shift)
    for fault in ("black", "blurred", "saturated", "hidden", "flash"):
        conditions_by_name[f"720p, {fault}"] = replace(small, fault=fault, fault_frames=15)
    return conditions_by_name


def runs_of(sequence: Sequence, markers: int) -> Iterator[Sequence]:
    """The same condition with other seeds, until there are enough markers.

    Seeds whose sheet cannot make the steps without folding are skipped.

    Raises:
        FoldError: too few seeds are left.
    """
    frames = 60 if sequence.fault != "none" else 50
    if sequence.dots > 1040:
        frames = 20
    wanted = -(-markers // (frames * sequence.dots))
    made = 0
    for seed in range(SEEDS_PER_RUN * wanted):
        run = replace(sequence, frames=frames, seed=seed)
        if can_move(run):
            yield run
            made += 1
            if made == wanted:
                return
    raise FoldError(
        f"only {made} of {SEEDS_PER_RUN * wanted} seeds make this step without folding: use a smaller step"
    )


def combine_scores(scores: list[Score]) -> Score:
    """Scores of several runs as one."""
    seen = np.array([each.seen for each in scores], dtype=np.float64)
    weight = np.maximum(seen, 1.0) / np.maximum(seen, 1.0).sum()
    relocks = [each.relock for each in scores if each.relock is not None]

    def mean(values: list[float]) -> float:
        return float(weight @ np.array(values))

    return Score(
        seen=int(seen.sum()),
        wrong_ok=sum(each.wrong_ok for each in scores),
        wrong_flagged=sum(each.wrong_flagged for each in scores),
        near=sum(each.near for each in scores),
        lost_percent=float(np.mean([each.lost_percent for each in scores])),
        relock=max(relocks) if relocks else None,
        rms_px=float(np.sqrt(mean([each.rms_px**2 for each in scores]))),
        chi2=mean([each.chi2 for each in scores]),
        ms=float(np.median([each.ms for each in scores])),
    )


HEADING = (
    f"{'':40} {'markers':>9} {'wrong':>8} {'(ok)':>7} {'near':>6} {'lost %':>8} {'relock':>6} "
    f"{'rms px':>7} {'chi2':>6} {'ms':>7}"
)


def table_row(name: str, result: Score) -> str:
    """A row of the table."""
    each = 1e5 / max(result.seen, 1)
    relock = "" if result.relock is None else str(result.relock)
    return (
        f"{name:40} {result.seen:9d} {result.wrong:8.1f} {each * result.wrong_ok:7.1f} "
        f"{each * result.near:6.1f} {result.lost_percent:8.3f} {relock:>6} "
        f"{result.rms_px:7.4f} {result.chi2:6.2f} {result.ms:7.2f}"
    )


def score_conditions(
    conditions_by_name: dict[str, Sequence],
    evaluate: Callable[[Sequence], Score],
    write: Callable[[str], None],
) -> dict[str, Score]:
    """Evaluate conditions one after the other and write a row for each."""
    write(HEADING)
    results = {}
    for name, sequence in conditions_by_name.items():
        results[name] = evaluate(sequence)
        write(table_row(name, results[name]))
    return results


def main() -> None:
    """Print both tables, and write them to a folder if one is given."""
    options = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument("--markers", type=int, default=100_000, help="per condition, from points")
    options.add_argument("--only", default="", help="conditions whose name contains this text")
    options.add_argument("--no-pictures", action="store_true", help="points only")
    options.add_argument("--out", type=Path, help="folder for identity.txt and identity.json")
    chosen = options.parse_args()
    lines: list[str] = []

    def write(text: str) -> None:
        lines.append(text)
        print(text, flush=True)

    def from_points(sequence: Sequence) -> Score:
        runs = (course_of(run) for run in runs_of(sequence, chosen.markers))
        return combine_scores([score(course, track_points(course, MarkerTracker())) for course in runs])

    def from_pictures(sequence: Sequence) -> Score:
        course = course_of(sequence)
        return score(course, track_pictures(course, DotSearch(), MarkerTracker()))

    begun_s = time.perf_counter()
    warm = course_of(Sequence(dots=96, frames=4, shift_pitches=0.6))
    score(warm, track_points(warm, MarkerTracker()))
    write("from points: tracking alone (wrong, ok and near per 100 000)")
    wanted = {name: each for name, each in conditions().items() if chosen.only in name}
    results = {"points": score_conditions(wanted, from_points, write)}
    if not chosen.no_pictures:
        write("\nfrom pictures: detection and tracking")
        wanted = {name: each for name, each in picture_conditions().items() if chosen.only in name}
        results["pictures"] = score_conditions(wanted, from_pictures, write)
    write("\ngoals: " + "; ".join(f"{name}: {goal}" for name, goal in GOALS.items()))
    write(f"{time.perf_counter() - begun_s:.0f} s")
    if chosen.out is not None:
        chosen.out.mkdir(parents=True, exist_ok=True)
        (chosen.out / "identity.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
        plain = {kind: {name: asdict(each) for name, each in rows.items()} for kind, rows in results.items()}
        (chosen.out / "identity.json").write_text(json.dumps(plain, indent=1), encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())

"""Peaks of a load map that are contacts."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64

from manytouch.estimation.frame_interval import remaining
from manytouch.estimation.load.load_estimator import LoadEstimate
from manytouch.values.arrays import Mask, Points2, Scalars


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LoadPeaks:
    """The peaks of one frame, the strongest first.

    Attributes:
        centre_mm: (c, 2) centroid of the load near each peak.
        covariance_mm2: (c, 2, 2) of the centres.
        load: (c,) load at the peak, times the pitch.
        load_std: (c,) standard deviation of it from the noise of the centres.
        area_mm2: (c,) of the part above half of the peak.
        may_start: (c,) clear enough to start a contact; the others can only continue one.
        floor: load below which no contact lasts in this frame.
        region: (ny, nx) number of the peak above half of which a point of the map lies, or -1.
    """

    centre_mm: Points2
    covariance_mm2: Float64[np.ndarray, "c 2 2"]
    load: Scalars
    load_std: Scalars
    area_mm2: Scalars
    may_start: Mask
    floor: float
    region: np.ndarray


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LoadPeakFinder:
    """Finds the peaks of a load map that are contacts.

    A contact must exceed the noise of the centres, what remains of an earlier press while the sheet creeps
    back, and the ripples around the strongest press.

    Attributes:
        start_load: least load times pitch (the angle in rad by which the slope turns within a pitch) of a new
            contact; a sheet that creeps back or settles after its frame was moved stays below.
        stay_load: least load times pitch of a contact that continues.
        creep_share: share of an earlier press that a soft sheet keeps for a while; no contact is below it.
        creep_s: time constant with which an earlier press fades.
        noise_stds: a new contact exceeds this many standard deviations of the noise, a lasting one half of
            it.
        start_share: a new contact exceeds this share of the strongest load in the frame.
        stay_share: a contact that continues exceeds this share of the strongest load in the frame.
        merge: two peaks are one if the saddle between them is above this share of the lower one.
        top_share: the centre is the centroid of the load above this share of the peak.
        model_std_pitch: least standard deviation of a centre that the model does not explain, in pitches.
        model_std_radius: standard deviation of a centre that the model does not explain, over the radius of
            the contact; added to `model_std_pitch` in quadrature.
    """

    start_load: float = 0.02
    stay_load: float = 0.015
    creep_share: float = 0.2
    creep_s: float = 1.65
    noise_stds: float = 6.0
    start_share: float = 0.45
    stay_share: float = 0.4
    merge: float = 0.75
    top_share: float = 0.7
    model_std_pitch: float = 0.15
    model_std_radius: float = 0.15

    def __call__(
        self,
        load: LoadEstimate,
        recent_load: float = 0.0,
        *,
        is_touched: bool = False,
        moved: Float64[np.ndarray, "ny nx"] | None = None,
    ) -> LoadPeaks:
        """The peaks of a load that are contacts.

        Args:
            load: of the frame.
            recent_load: strongest load of the frames before, from `fade`.
            is_touched: whether it is known that something touches the sheet: the strongest peak is then a
                contact, whatever its load.
            moved: (ny, nx) how far markers have moved near each point of the map, to be used instead of the
                load. None: the load.
        """
        from manytouch.estimation.load.peak_kernels import shapes_of_peaks
        from manytouch.estimation.watershed import watershed

        load_map = load.load_map
        if moved is None:
            value = np.ascontiguousarray(load_map.load_on_grid(load.coefficients))
        else:
            value = np.ascontiguousarray(self.stay_load / float(moved.max()) * moved)
        strongest = float(value.max())
        crept = self.creep_share * recent_load
        least = max(self.stay_load, crept)
        floor = max(least, self.stay_share * strongest)
        if is_touched:
            floor = min(floor, 0.99 * strongest)
        if not strongest > floor:
            return _no_peaks(value, least)
        label, peak = watershed(value, floor / 2.0, self.merge)
        height = value.ravel()[peak]
        column, row = peak % len(load_map.x_mm), peak // len(load_map.x_mm)
        peak_mm = np.column_stack([load_map.x_mm[column], load_map.y_mm[row]])
        # Peaks are sorted by height, the highest first.
        count = int((height > floor).sum())
        std = np.full(len(peak), np.inf)
        std[:count] = load_map.load_std(peak_mm[:count], load.variance)
        stays = height > np.maximum(floor, 0.5 * self.noise_stds * std)
        stays[0] |= is_touched
        if not stays.any():
            return _no_peaks(value, least)
        centre_mm, area_mm2, region = shapes_of_peaks(
            value, label, height, stays, load_map.x_mm, load_map.y_mm, self.top_share
        )
        height, std, peak_mm = height[stays], std[stays], peak_mm[stays]
        model_mm = np.hypot(
            self.model_std_pitch * load_map.pitch_mm, self.model_std_radius * np.sqrt(area_mm2 / np.pi)
        )
        covariance_mm2 = model_mm[:, None, None] ** 2 * np.eye(2)
        if moved is None:
            covariance_mm2 += load_map.centre_covariance(peak_mm, load.variance, load.coefficients)
        start = max(self.start_load, crept, self.start_share * strongest)
        may_start = (height > start) & (height > self.noise_stds * std)
        may_start[0] |= is_touched
        return LoadPeaks(
            centre_mm=centre_mm,
            covariance_mm2=covariance_mm2,
            load=height,
            load_std=std,
            area_mm2=area_mm2,
            may_start=may_start,
            floor=min(least, floor),
            region=region,
        )

    def none(self, load: LoadEstimate) -> LoadPeaks:
        """No contacts: nothing on the sheet has moved."""
        return _no_peaks(load.load_map.divisor, float("inf"))

    def fade(self, peaks: LoadPeaks, recent_load: float, *, elapsed_s: float) -> float:
        """The strongest load of this frame and of those before, which fades, so long after the last one."""
        return float(max([remaining(elapsed_s, self.creep_s) * recent_load, *peaks.load.tolist()]))


def chosen_peaks(peaks: LoadPeaks, keep: Mask) -> LoadPeaks:
    """Some of the peaks, by a mask (c,)."""
    number = np.append(np.where(keep, np.cumsum(keep) - 1, -1), -1)
    return replace(
        peaks,
        centre_mm=peaks.centre_mm[keep],
        covariance_mm2=peaks.covariance_mm2[keep],
        load=peaks.load[keep],
        load_std=peaks.load_std[keep],
        area_mm2=peaks.area_mm2[keep],
        may_start=peaks.may_start[keep],
        region=number[peaks.region],
    )


def _no_peaks(load: np.ndarray, floor: float) -> LoadPeaks:
    """No contacts on a map (ny, nx)."""
    return LoadPeaks(
        centre_mm=np.zeros((0, 2)),
        covariance_mm2=np.zeros((0, 2, 2)),
        load=np.zeros(0),
        load_std=np.zeros(0),
        area_mm2=np.zeros(0),
        may_start=np.zeros(0, dtype=np.bool_),
        floor=floor,
        region=np.full(load.shape, -1, dtype=np.int64),
    )

"""Contacts of one frame: the hills of the load map."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from manytouch.estimation.perimeter.load_map import LoadMap
from manytouch.values.arrays import Mask, Points2, Scalars


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class LoadPeaks:
    """What presses, the strongest first.

    Attributes:
        centre_mm: (c, 2) centroid of the load near each hill's top.
        covariance_mm2: (c, 2, 2) of the centres.
        load: (c,) load at the peak, times the pitch.
        load_std: (c,) of it, from the noise of the centres.
        area_mm2: (c,) of the upper half.
        is_firm: (c,) clear enough to begin a contact; the others can only continue one.
        floor: load below which nothing counts in this frame.
        member: (ny, nx) hill whose upper half a point of the map belongs to, or -1.
    """

    centre_mm: Points2
    covariance_mm2: Float64[np.ndarray, "c 2 2"]
    load: Scalars
    load_std: Scalars
    area_mm2: Scalars
    is_firm: Mask
    floor: float
    member: np.ndarray


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ContactFinder:
    """Tells which hills of the load map are contacts.

    A contact must stand out from the noise of the centres, from what a sheet creeps, and from the ripples
    around the strongest press.

    Attributes:
        start_load: least load times pitch (the angle in rad that the slope turns within a pitch) of a new
            contact; a sheet that creeps back or rests anew after its frame was moved stays below.
        stay_load: a contact lasts while it stays above.
        creep_share: of a press that is just gone, a soft sheet keeps up to this share for a while; nothing
            below it is a contact.
        creep_memory: part of that which is left a frame later.
        noise_stds: and above this many standard deviations of the noise, to start; half of it to stay.
        start_share: a new contact is above this share of the strongest load in the frame.
        stay_share: an old one stays above.
        merge: two hills are one if the saddle between them is above this share of the lower one's peak.
        top_share: the centre is the centroid of what lies above this share of the peak.
        model_std_pitch: of a centre, for what the model does not explain: at least this.
        model_std_radius: and at least this share of the contact's radius.
    """

    start_load: float = 0.02
    stay_load: float = 0.015
    creep_share: float = 0.2
    creep_memory: float = 0.98
    noise_stds: float = 6.0
    start_share: float = 0.45
    stay_share: float = 0.4
    merge: float = 0.75
    top_share: float = 0.7
    model_std_pitch: float = 0.15
    model_std_radius: float = 0.15

    def __call__(
        self,
        chart: LoadMap,
        modes: Float64[np.ndarray, "k l"],
        variance: float,
        recent_load: float = 0.0,
    ) -> LoadPeaks:
        """The contacts in a load.

        Args:
            chart: of the load.
            modes: its coefficients.
            variance: of what they were taken from in this frame, by the noise of the picture.
            recent_load: strongest load of the frames before, as `remembered` keeps it.
        """
        from manytouch.estimation.kernels import hills

        load = chart.load(modes)
        strongest = float(load.max())
        crept = self.creep_share * recent_load
        floor = max(self.stay_load, crept, self.stay_share * strongest)
        if not strongest > floor:
            return _nothing(load, max(self.stay_load, crept))
        label, peak = hills(np.ascontiguousarray(load), floor / 2.0, self.merge)
        height = load.ravel()[peak]
        column, row = peak % len(chart.x_mm), peak // len(chart.x_mm)
        top_mm = np.column_stack([chart.x_mm[column], chart.y_mm[row]])
        # Peaks come the highest first, so that those above a height are the first.
        high = int((height > floor).sum())
        std = np.full(len(peak), np.inf)
        std[:high] = chart.load_std(top_mm[:high], variance)
        stays = height > np.maximum(floor, 0.5 * self.noise_stds * std)
        if not stays.any():
            return _nothing(load, max(self.stay_load, crept))
        centre_mm, area_mm2, member = self._shapes(chart, load, label, height, stays)
        height, std, top_mm = height[stays], std[stays], top_mm[stays]
        model = np.hypot(
            self.model_std_pitch * chart.pitch_mm, self.model_std_radius * np.sqrt(area_mm2 / np.pi)
        )
        covariance = chart.centre_covariance(top_mm, variance, modes) + model[:, None, None] ** 2 * np.eye(2)
        firm = max(self.start_load, crept, self.start_share * strongest)
        return LoadPeaks(
            centre_mm=centre_mm,
            covariance_mm2=covariance,
            load=height,
            load_std=std,
            area_mm2=area_mm2,
            is_firm=(height > firm) & (height > self.noise_stds * std),
            floor=max(self.stay_load, crept),
            member=member,
        )

    def remembered(self, found: LoadPeaks, recent_load: float) -> float:
        """The strongest load up to now, which fades."""
        return float(max([self.creep_memory * recent_load, *found.load.tolist()]))

    def _shapes(
        self, chart: LoadMap, load: np.ndarray, label: np.ndarray, height: np.ndarray, stays: np.ndarray
    ) -> tuple[Points2, Scalars, np.ndarray]:
        """Centres and areas of those of the hills that stay, and the map of whose upper half is where."""
        at = np.flatnonzero(label >= 0)
        at = at[stays[label.ravel()[at]]]
        hill, value = (np.cumsum(stays) - 1)[label.ravel()[at]], load.ravel()[at]
        share = value / height[stays][hill]
        member = np.full(load.shape, -1, dtype=np.int64)
        member.ravel()[at[share > 0.5]] = hill[share > 0.5]
        count = int(stays.sum())
        cell_mm2 = float((chart.x_mm[1] - chart.x_mm[0]) * (chart.y_mm[1] - chart.y_mm[0]))
        area_mm2 = np.bincount(hill[share > 0.5], minlength=count) * cell_mm2
        weight = np.where(share > self.top_share, value, 0.0)
        row, column = np.divmod(at, load.shape[1])
        total = np.bincount(hill, weight, minlength=count)
        x_mm = np.bincount(hill, weight * chart.x_mm[column], minlength=count) / total
        y_mm = np.bincount(hill, weight * chart.y_mm[row], minlength=count) / total
        return np.column_stack([x_mm, y_mm]), area_mm2, member


def _nothing(load: np.ndarray, floor: float) -> LoadPeaks:
    """No hills on a map."""
    return LoadPeaks(
        centre_mm=np.zeros((0, 2)),
        covariance_mm2=np.zeros((0, 2, 2)),
        load=np.zeros(0),
        load_std=np.zeros(0),
        area_mm2=np.zeros(0),
        is_firm=np.zeros(0, dtype=np.bool_),
        floor=floor,
        member=np.full(load.shape, -1, dtype=np.int64),
    )

"""Positions of fingers from the swelling of the dots, for a view or a sheet that was assumed.

Distances, slopes and the sheet outside of the view are then poorly known, so that displacements show whether
something touches the sheet, but not where. Three logarithmic changes at each marker do not depend on them:
the growth of its dot (g), the growth of the area between it and its neighbours (a), and twice the growth of
distances across the rays (b). A sheet that comes nearer by w at the distance d from the camera and at r from
the optical axis stretches by w/d across the rays and by (w + r . grad w)/d along them:

    a = 2 w/d + r . grad w/d + ...,      b = 2 w/d + ...,      g = a + light

r . grad w is odd about a press, and moves the largest a and g towards the axis by about half of r; b does not
contain it. g - a does not depend on the shape of the sheet but on light and blur near the finger, which
change dots and the gaps between them differently. Which of these is reliable depends on where the stretch
comes from. The sum of a over the view is what crosses its border (the divergence theorem). Where next to
nothing shrinks, the sheet spreads sideways under a press: a is largest at the press. A free sheet shrinks as
much around a press as it grows under it, and more when it is drawn in from outside of the view. With h =
twice the share of shrinking, at most 1, the swelling is

    v = h (g - a) + c ((1 - h) a + h b)

It is modelled as a sum of finger-sized bumps, of a background that changes slowly, and of noise. See
docs/derivations/uncalibrated.md.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64

from manytouch.estimation.load.cosine_series import (
    CosineSeries,
    best_linear_estimate,
    finest_affordable_wavelength,
    wave_numbers,
)
from manytouch.estimation.load.load_map import LoadMap, make_load_map
from manytouch.values import Layout
from manytouch.values.arrays import Points2, Scalars, read_only


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SwellingMap:
    """Where fingers are likely on one layout, and how well they fit. Lengths are in pitches inside.

    Attributes:
        load_map: from the swelling to a load.
        rest: (m, 2) markers.
        weight: (m,) inverse variances of the swelling.
        background: (m, r) functions of the background, each of standard size, times `weight`.
        inner: (r, r) (1 + background^T weight background)^-1.
        pitch_mm: geometric mean of the pitches.
    """

    load_map: LoadMap
    rest: Points2
    weight: Scalars
    background: np.ndarray
    inner: np.ndarray
    pitch_mm: float

    def apply_inverse_covariance(self, rows: np.ndarray) -> np.ndarray:
        """Rows (..., m) times the inverse covariance of background and noise (Woodbury)."""
        return np.asarray(rows * self.weight - (rows @ self.background) @ self.inner @ self.background.T)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SwellingModel:
    """Prior of fingers and of the background. A swelling is a logarithmic change, without unit.

    Attributes:
        shape_weight: c, the weight of the sheet's shape relative to light and blur.
        radius: standard deviation of the bump under a finger in the map, in pitches.
        size: usual height of the bump under a finger, as a swelling.
        reach: length over which the background changes, in pitches.
        background: standard deviation of the part of the background that changes slowly, as a swelling.
        level: standard deviation of the constant part of the background, as a swelling.
        error: standard deviation of the swelling at a marker by noise. It increases with the fourth power of
            the ratio of the median dot area at rest to the dot's own, because a half-printed dot seems to
            grow when the light changes.
        margin: extent of the model beyond the outer markers, in pitches.
        finest: shortest wavelength of the map, in pitches.
        most_products: largest number of cosine products in the map.
        fit_radius: standard deviation of a bump when its centre is fitted, in pitches; a finger lies on the
            sheet behind its tip.
        farthest, prior_std: largest and usual distance of a fitted centre from the initial one, in pitches.
        steps: number of Gauss-Newton steps of a fit.
    """

    shape_weight: float = 0.8
    radius: float = 1.4
    size: float = 0.1
    reach: float = 8.0
    background: float = 0.1
    level: float = 0.3
    error: float = 0.05
    margin: float = 2.0
    finest: float = 3.0
    most_products: int = 420
    fit_radius: float = 1.6
    farthest: float = 1.5
    prior_std: float = 2.0
    steps: int = 3

    def __call__(self, layout: Layout, rest_mm: Points2, points_per_pitch: float) -> SwellingMap:
        """For markers at rest (m, 2) in the plane of the sheet, with the resolution of the map."""
        pitch_mm = float(np.sqrt(np.prod(layout.pitch_mm)))
        pitch, rest = layout.pitch_mm / pitch_mm, rest_mm / pitch_mm
        low = rest.min(axis=0) - self.margin * pitch
        size = rest.max(axis=0) + self.margin * pitch - low
        error = self.error * np.minimum(1.0, _relative_radius(layout)) ** -8.0
        # Bumps of this radius at random positions have a covariance of width sqrt(2) times the radius.
        finest = finest_affordable_wavelength(size, pitch, self.finest, self.most_products)
        fingers = _stationary_process(
            low, wave_numbers(size, pitch, finest), self.size, np.sqrt(2.0) * self.radius
        )
        slow = _stationary_process(
            low, wave_numbers(size, pitch, 2.5 * self.reach), self.background, self.reach
        )

        def swelling(at: slice) -> np.ndarray:
            return np.concatenate([fingers(rest[at]), self._background(slow, rest[at])], axis=1)[None]

        estimate, spread = best_linear_estimate(swelling, error, np.ones(len(fingers.scale)))
        background = self._background(slow, rest)
        weighted = background / error[:, None] ** 2
        return SwellingMap(
            load_map=make_load_map(
                layout,
                rest_mm,
                low=low,
                wave=(fingers.wave_x, fingers.wave_y),
                estimate=estimate,
                spread=spread,
                points_per_pitch=points_per_pitch,
                sensitivity=estimate.astype(np.float64) @ fingers(rest),
            ),
            rest=read_only(rest),
            weight=read_only(error**-2.0),
            background=read_only(weighted),
            inner=read_only(np.linalg.inv(np.eye(background.shape[1]) + background.T @ weighted)),
            pitch_mm=pitch_mm,
        )

    def swelling(self, growth: Scalars | None, area: Scalars, across: Scalars) -> Scalars:
        """(m,) swelling above the median of all markers; below it the sheet only tilts.

        Args:
            growth: (m,) of the dots; None for a frame without areas.
            area, across: (m,) from `MarkerSpacing`.
        """
        shrinking, total = np.maximum(-area, 0.0).sum(), np.abs(area).sum()
        free = float(min(1.0, 2.0 * shrinking / max(total, 1e-12)))
        swelling = self.shape_weight * ((1.0 - free) * area + free * across)
        if growth is not None:
            swelling = swelling + free * (growth - area)
        return np.asarray(np.maximum(swelling - np.median(swelling), 0.0))

    def fit_centres(
        self,
        swelling_map: SwellingMap,
        centre_mm: Float64[np.ndarray, "c 2"],
        swelling: Float64[np.ndarray, " m"],
    ) -> Float64[np.ndarray, "c 2"]:
        """Centres (c, 2) of all fingers together that fit the swelling (m,) best.

        Gauss-Newton steps for centres and heights from the initial centres; the background is eliminated.
        """
        initial = centre_mm / swelling_map.pitch_mm
        count, centre, height = len(initial), initial, np.zeros(0)
        prior = np.repeat([1e-6, self.prior_std**-2.0], [count, 2 * count])
        for step in range(self.steps):
            offset = swelling_map.rest - centre[:, None]
            bump = np.exp(-0.5 * (offset**2).sum(axis=2) / self.fit_radius**2)
            weighted = swelling_map.apply_inverse_covariance(bump)
            if step == 0:
                gram = weighted @ bump.T + 1e-6 * np.eye(count)
                height = np.maximum(np.linalg.solve(gram, weighted @ swelling), 0.2 * self.size)
            slope = height[:, None] * bump * offset.transpose(2, 0, 1) / self.fit_radius**2
            rows = np.concatenate([bump, slope[0], slope[1]])
            weighted = swelling_map.apply_inverse_covariance(rows)
            gradient = weighted @ (swelling - height @ bump)
            gradient[count:] -= prior[count:] * (centre - initial).T.ravel()
            change = np.linalg.solve(weighted @ rows.T + np.diag(prior), gradient)
            height = np.maximum(height + change[:count], 0.1 * self.size)
            centre = centre + _limit_length(change[count:].reshape(2, count).T, 0.5)
        return np.asarray((initial + _limit_length(centre - initial, self.farthest)) * swelling_map.pitch_mm)

    def _background(self, slow: CosineSeries, rest: Points2) -> np.ndarray:
        """(n, r) functions of the background at points (n, 2)."""
        return np.column_stack([slow(rest), np.full(len(rest), self.level)])


def _relative_radius(layout: Layout) -> Scalars:
    """(m,) radius of each dot over their median, as measured where that is known."""
    radius = layout.radius_mm if layout.rest_radius_px is None else layout.rest_radius_px
    if not np.isfinite(radius).any():
        radius = layout.radius_mm
    relative = radius / np.nanmedian(radius)
    return np.asarray(np.where(np.isfinite(relative), relative, 1.0))


def _stationary_process(
    low: np.ndarray, wave: tuple[np.ndarray, np.ndarray], size: float, length: float
) -> CosineSeries:
    """A series whose covariance at the distance s is size^2 exp(-s^2 / (2 length^2))."""
    white = CosineSeries(low=low, wave_x=wave[0], wave_y=wave[1], scale=np.ones(1))
    spectrum = 2.0 * np.pi * length**2 * np.exp(-0.5 * length**2 * white.square)
    return replace(white, scale=size * np.sqrt(spectrum))


def _limit_length(vector: Float64[np.ndarray, "c 2"], longest: float) -> Float64[np.ndarray, "c 2"]:
    """Vectors (c, 2), shortened to a length of at most `longest`."""
    length = np.linalg.norm(vector, axis=1, keepdims=True)
    return np.asarray(vector * np.minimum(1.0, longest / np.maximum(length, 1e-12)))

"""Where fingers press when the camera's view was assumed: from how the dots swell.

Distances, slopes and the sheet beyond the view are then hardly known, so that displacements tell whether
something touches, but not where. What is seen around a marker without knowing them is how much its dot has
grown (g), how much the areas between it and its neighbours have (a), and twice how much its distances across
the rays have (b), all as logarithms. A sheet that comes nearer by w at the distance d from the camera and at
r from the optical axis stretches by w/d across the rays and by (w + r . grad w)/d along them:

    a = 2 w/d + r . grad w/d + ...,      b = 2 w/d + ...,      g = a + light

r . grad w is odd about a press, and draws the largest a and g towards the axis by about half of r; b is free
of it. g - a is not of the sheet's shape but of the light and the blur at what is near, in which alone dots
differ from the gaps between them. Which of these to trust depends on where the stretch comes from. The sum
of a over the view is what crosses its border (the divergence theorem). Where next to nothing shrinks, the
sheet spreads sideways under a press: a is where the press is. A sheet that hangs shrinks as much around a
press as it grows under it, and more when it is drawn in from beyond the view. With h = twice the share of
shrinking, at most 1, the swelling is

    v = h (g - a) + c ((1 - h) a + h b)

It is taken for a sum of pads, hills as wide as a fingertip, of a background that changes slowly, and of
noise. See docs/derivations/pads.md.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64

from manytouch.estimation.perimeter.cosine_series import Series, affordable, best_estimate, waves
from manytouch.estimation.perimeter.load_map import LoadMap, chart
from manytouch.values import Layout
from manytouch.values.arrays import Points2, Scalars, read_only


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SwellingMap:
    """For one layout: where pads are likely, and how well they fit. Lengths are in pitches inside.

    Attributes:
        chart: from the swelling to where pads are likely.
        rest: (m, 2) markers.
        weight: (m,) inverse variances of the swelling.
        behind: (m, r) functions of the background, each of usual size, times `weight`.
        inner: (r, r) (1 + background^T weight background)^-1.
        pitch_mm: the unit.
    """

    chart: LoadMap
    rest: Points2
    weight: Scalars
    behind: np.ndarray
    inner: np.ndarray
    pitch_mm: float

    def weighed(self, rows: np.ndarray) -> np.ndarray:
        """Rows (..., m) times the inverse covariance of background and noise (Woodbury)."""
        return np.asarray(rows * self.weight - (rows @ self.behind) @ self.inner @ self.behind.T)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SwellingModel:
    """What is assumed of pads and of what else swells; lengths in pitches.

    Attributes:
        nearness: c, the weight of the sheet's shape against what light and blur tell.
        radius: of a pad when pads are told apart, as standard deviation of its hill.
        size: of a pad's swelling.
        reach: over which the background changes.
        background: its size, and
        level: that of what is the same everywhere.
        error: of a swelling. It rises with the fourth power of how much smaller than usual a dot's area is
            at rest, since a half-printed dot seems to grow when the light changes.
        margin: how far all this goes on beyond the outer markers.
        finest: shortest wavelength of the map.
        most_products: of cosines in the map.
        fit_radius: of a pad when its centre is fitted; a finger lies on the sheet behind its tip.
        farthest, slack: a fit stays so near to where it began; and the usual distance.
        steps: of a fit.
    """

    nearness: float = 0.8
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
    slack: float = 2.0
    steps: int = 3

    def __call__(self, layout: Layout, rest_mm: Points2, points_per_pitch: float) -> SwellingMap:
        """For markers that rest at (m, 2) in the plane of the sheet; so many points has the map."""
        pitch_mm = float(np.sqrt(np.prod(layout.pitch_mm)))
        pitch, rest = layout.pitch_mm / pitch_mm, rest_mm / pitch_mm
        low = rest.min(axis=0) - self.margin * pitch
        size = rest.max(axis=0) + self.margin * pitch - low
        radius = np.median(layout.radius_mm) / layout.radius_mm
        error = self.error * np.maximum(1.0, radius) ** 8
        # LoadPeaks of this radius at random places: a covariance of width sqrt(2) times the radius.
        finest = affordable(size, pitch, self.finest, self.most_products)
        pads = _process(low, waves(size, pitch, finest), self.size, np.sqrt(2.0) * self.radius)
        ground = _process(low, waves(size, pitch, 2.5 * self.reach), self.background, self.reach)

        def swelling(at: slice) -> np.ndarray:
            return np.concatenate([pads(rest[at]), self._behind(ground, rest[at])], axis=1)[None]

        estimate, spread = best_estimate(swelling, error, np.ones(len(pads.scale)))
        behind = self._behind(ground, rest)
        weighted = behind / error[:, None] ** 2
        return SwellingMap(
            chart=chart(
                layout,
                rest_mm,
                low=low,
                wave=(pads.wave_x, pads.wave_y),
                estimate=estimate,
                spread=spread,
                points_per_pitch=points_per_pitch,
                evenness=estimate.astype(np.float64) @ pads(rest),
            ),
            rest=read_only(rest),
            weight=read_only(error**-2.0),
            behind=read_only(weighted),
            inner=read_only(np.linalg.inv(np.eye(behind.shape[1]) + behind.T @ weighted)),
            pitch_mm=pitch_mm,
        )

    def swelling(self, growth: Scalars | None, area: Scalars, across: Scalars) -> Scalars:
        """(m,) what is above the middle one of all markers; the rest is a sheet that leans away.

        Args:
            growth: (m,) of the dots; None when nothing measured it.
            area, across: (m,) as `Spacing` gives them.
        """
        shrunk, all_of_it = np.maximum(-area, 0.0).sum(), np.abs(area).sum()
        hangs = float(min(1.0, 2.0 * shrunk / max(all_of_it, 1e-12)))
        swelling = self.nearness * ((1.0 - hangs) * area + hangs * across)
        if growth is not None:
            swelling = swelling + hangs * (growth - area)
        return np.asarray(np.maximum(swelling - np.median(swelling), 0.0))

    def fitted(
        self, pads: SwellingMap, centre_mm: Float64[np.ndarray, "c 2"], swelling: Float64[np.ndarray, " m"]
    ) -> Float64[np.ndarray, "c 2"]:
        """Centres (c, 2) of all pads at once that fit the swelling (m,) best, from where they were found.

        Gauss-Newton steps for centres and heights, the background being eliminated.
        """
        begun = centre_mm / pads.pitch_mm
        count, place, height = len(begun), begun, np.zeros(0)
        slack = np.repeat([1e-6, self.slack**-2.0], [count, 2 * count])
        for step in range(self.steps):
            away = pads.rest - place[:, None]
            hill = np.exp(-0.5 * (away**2).sum(axis=2) / self.fit_radius**2)
            weighed = pads.weighed(hill)
            if step == 0:
                gram = weighed @ hill.T + 1e-6 * np.eye(count)
                height = np.maximum(np.linalg.solve(gram, weighed @ swelling), 0.2 * self.size)
            lean = height[:, None] * hill * away.transpose(2, 0, 1) / self.fit_radius**2
            rows = np.concatenate([hill, lean[0], lean[1]])
            weighed = pads.weighed(rows)
            moved = (place - begun).T.ravel()
            gradient = weighed @ (swelling - height @ hill)
            gradient[count:] -= slack[count:] * moved
            change = np.linalg.solve(weighed @ rows.T + np.diag(slack), gradient)
            height = np.maximum(height + change[:count], 0.1 * self.size)
            place = place + _no_longer(change[count:].reshape(2, count).T, 0.5)
        return np.asarray((begun + _no_longer(place - begun, self.farthest)) * pads.pitch_mm)

    def _behind(self, ground: Series, rest: Points2) -> np.ndarray:
        return np.column_stack([ground(rest), np.full(len(rest), self.level)])


def _process(low: np.ndarray, wave: tuple[np.ndarray, np.ndarray], size: float, length: float) -> Series:
    """A series whose covariance falls with the distance s as size^2 exp(-s^2 / (2 length^2))."""
    plain = Series(low=low, wave_x=wave[0], wave_y=wave[1], scale=np.ones(1))
    spectrum = 2.0 * np.pi * length**2 * np.exp(-0.5 * length**2 * plain.square)
    return replace(plain, scale=size * np.sqrt(spectrum))


def _no_longer(way: Float64[np.ndarray, "c 2"], most: float) -> Float64[np.ndarray, "c 2"]:
    length = np.linalg.norm(way, axis=1, keepdims=True)
    return np.asarray(way * np.minimum(1.0, most / np.maximum(length, 1e-12)))

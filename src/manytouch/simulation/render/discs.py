"""Pictures of dots as a camera would give them: anti-aliased, blurred, unevenly lit and noisy.

The point spread is a Gaussian that stands for lens and pixel together; an image is its convolution
with the dots, sampled at the pixels' centres. For an ellipse whose smallest radius of curvature is
large against the blur, the convolution is taken along the boundary's normal,

    I(d) = Phi(-d / s) - (s k / 2) phi(d / s),    d signed distance, k curvature, s blur,

which leaves an error of order (s k)^2; smaller dots are integrated over their chords.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from manytouch.simulation.render.kernels import (
    Levels,
    Noise,
    Spots,
    add_discs,
    normal_quantiles,
    photograph,
    profile_table,
)
from manytouch.values.arrays import Covariances2, Image, Points2, Scalars, read_only


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Spot:
    """A round, soft patch of light or shadow: a Gaussian.

    Attributes:
        centre_px: x, y.
        radius_px: one standard deviation.
        amount: grey levels of 255 that a glare adds, or the fraction of light (0 to 1) that a shadow takes.
    """

    centre_px: tuple[float, float]
    radius_px: float
    amount: float


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Look:
    """How the dotted sheet looks, in grey levels of 255 before noise.

    Attributes:
        ground, dot: grey level, or levels of blue, green, red for a colour image. Dots lighter than
            their ground are of light polarity, darker ones of dark.
        tilt_x, tilt_y: relative change of the light from the middle to the right and lower border.
        vignetting: fraction of the light that is lost in the corners.
        glare: spots added on top of everything.
        shadows: spots that take light away.
        read_noise: standard deviation in grey levels of 255.
        shot_noise: variance per grey level of 255, in grey levels of 255.
        gain: of the light as a whole.
    """

    ground: float | tuple[float, float, float] = 45.0
    dot: float | tuple[float, float, float] = 205.0
    tilt_x: float = 0.0
    tilt_y: float = 0.0
    vignetting: float = 0.0
    glare: tuple[Spot, ...] = ()
    shadows: tuple[Spot, ...] = ()
    read_noise: float = 0.0
    shot_noise: float = 0.0
    gain: float = 1.0


LIGHT_DOTS = Look()
DARK_DOTS = Look(ground=190.0, dot=50.0)


def render_discs(
    centre_px: Points2,
    shape_px: Covariances2,
    *,
    width_px: int,
    height_px: int,
    blur_px: float | Scalars = 0.8,
    look: Look = LIGHT_DOTS,
    contrast: Scalars | None = None,
    cut: Float64[np.ndarray, "n 3"] | None = None,
    seed: int | None = None,
    bits: int = 8,
) -> Image:
    """Picture of elliptic dots; each is {centre + shape @ u, |u| <= 1}, blurred.

    Args:
        centre_px: (n, 2) x, y; (0, 0) is the centre of the first pixel. Rows with NaN are left out.
        shape_px: (n, 2, 2) maps the unit disc to the dot; its columns are conjugate half axes.
        width_px, height_px: size of the image.
        blur_px: standard deviation of the point spread, lens and pixel together; (n,) where dots differ.
        look: levels, light and noise.
        contrast: (n,) of each dot against the look's; 1 where not given, 0 is invisible.
        cut: (n, 3) a, b, c: only the part with a u_x + b u_y <= c is printed; infinite c prints all.
        seed: of the noise; no noise when None.
        bits: 8 or 16; a 16-bit image has the same look in 257 times finer levels.

    Returns:
        (height, width), or (height, width, 3) in BGR order for a look in colour.
    """
    coverage = disc_coverage(
        centre_px,
        shape_px,
        width_px=width_px,
        height_px=height_px,
        blur_px=blur_px,
        contrast=contrast,
        cut=cut,
    )
    return image_from_coverage(coverage, look=look, seed=seed, bits=bits)


def disc_coverage(
    centre_px: Points2,
    shape_px: Covariances2,
    *,
    width_px: int,
    height_px: int,
    blur_px: float | Scalars = 0.8,
    contrast: Scalars | None = None,
    cut: Float64[np.ndarray, "n 3"] | None = None,
) -> np.ndarray:
    """(height, width) float32: how much of each pixel's light comes from dots, 0 to 1; see `render_discs`."""
    count = len(centre_px)
    coverage = np.zeros((height_px, width_px), dtype=np.float32)
    whole = np.tile([0.0, 0.0, np.inf], (count, 1))
    add_discs(
        coverage,
        np.ascontiguousarray(centre_px),
        np.ascontiguousarray(shape_px),
        np.ones(count) if contrast is None else np.ascontiguousarray(contrast),
        whole if cut is None else np.ascontiguousarray(cut),
        np.broadcast_to(np.asarray(blur_px, dtype=np.float64), count).copy(),
        profile_table(),
    )
    return coverage


def image_from_coverage(
    coverage: np.ndarray, *, look: Look = LIGHT_DOTS, seed: int | None = None, bits: int = 8
) -> Image:
    """The picture of a coverage under a look's light and noise; see `render_discs`."""
    height, width = coverage.shape
    ground, dot = np.atleast_1d(look.ground), np.atleast_1d(look.dot)
    ground, dot = np.broadcast_arrays(ground.astype(np.float32), dot.astype(np.float32))
    is_noisy = seed is not None and (look.read_noise > 0 or look.shot_noise > 0)
    pixels = np.empty((height, width, len(ground)), dtype=np.uint16 if bits == 16 else np.uint8)
    light = np.array([look.tilt_x, look.tilt_y, look.vignetting, look.gain], dtype=np.float32)
    levels = Levels(ground=ground.copy(), dot=dot.copy(), light=light)
    spots = Spots(*_separable(look.glare, width, height), *_separable(look.shadows, width, height))
    noise = Noise(
        is_noisy=is_noisy,
        seed=np.uint64(0 if seed is None else seed % 2**64),
        variance=np.array([look.read_noise**2, look.shot_noise], dtype=np.float32),
        quantiles=normal_quantiles(),
    )
    photograph(pixels, coverage, levels, spots, noise, np.float32(257.0 if bits == 16 else 1.0))
    read_only(pixels)
    return pixels[:, :, 0] if len(ground) == 1 else pixels


def _separable(spots: tuple[Spot, ...], width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
    """Factorisation (s, width) and (s, height) whose outer products are the spots."""
    along_x = np.zeros((len(spots), width), dtype=np.float32)
    along_y = np.zeros((len(spots), height), dtype=np.float32)
    for place, spot in enumerate(spots):
        x, y = spot.centre_px
        along_x[place] = spot.amount * np.exp(-0.5 * ((np.arange(width) - x) / spot.radius_px) ** 2)
        along_y[place] = np.exp(-0.5 * ((np.arange(height) - y) / spot.radius_px) ** 2)
    return along_x, along_y

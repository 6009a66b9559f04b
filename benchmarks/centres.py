"""Errors of the centres of rendered dots, and what their covariances predict.

    python benchmarks/centres.py [--images 12]

Discs of some radii at random parts of pixels, dark and light, with even noise and with noise that grows with
light, sharp and blurred. Each entry is the RMS of the error along an axis in thousandths of a pixel, and the
mean squared error over the predicted one (1 is right).
"""

import argparse

import numpy as np

from manytouch.detection import estimate_noise, measure
from manytouch.simulation.render.discs import Look, render_discs

WIDTH, HEIGHT, BORDER = 640, 480, 50
LOW, HIGH = 45.0, 205.0
RADII_PX = (1.8, 2.4, 3.0, 4.0, 6.0, 8.5, 10.0, 20.0)
BLURS_PX = (0.5, 0.8, 1.2, 1.6)
NOISES = (0.0, 2.5, 10.0)
OFF_PX = 0.3  # of the expected position


def places_px(radius_px: float, rng: np.random.Generator) -> np.ndarray:
    pitch_px = max(5.0 * radius_px, 24.0)
    x, y = np.meshgrid(
        np.arange(BORDER, WIDTH - BORDER, pitch_px), np.arange(BORDER, HEIGHT - BORDER, pitch_px)
    )
    return np.stack([x.ravel(), y.ravel()], axis=1) + rng.uniform(-0.5, 0.5, (x.size, 2))


def entry(radius_px: float, look: Look, blur_px: float, images: int) -> str:
    """RMS in thousandths of a pixel and ratio of the squares."""
    rng, sign = np.random.default_rng(int(100 * radius_px)), np.sign(look.dot - look.ground)
    errors_px, squares = [], []
    for seed in range(images):
        centre_px = places_px(radius_px, rng)
        shape_px = np.tile(radius_px * np.eye(2), (len(centre_px), 1, 1))
        image = render_discs(
            centre_px, shape_px, width_px=WIDTH, height_px=HEIGHT, look=look, seed=seed, blur_px=blur_px
        )
        weights, near_px = np.array([sign]), centre_px + rng.uniform(-OFF_PX, OFF_PX, centre_px.shape)
        radii_px = np.full(len(centre_px), radius_px)
        dots = measure(image, weights, near_px, radii_px, noise=estimate_noise(image, weights))
        error_px = (dots.centre_px - centre_px)[dots.is_found]
        inverse = np.linalg.inv(dots.covariance_px2[dots.is_found])
        errors_px.append(error_px)
        squares.append(0.5 * np.einsum("ni,nij,nj->n", error_px, inverse, error_px))
    rms_px = float(np.sqrt(np.square(np.concatenate(errors_px)).mean()))
    return f"{1e3 * rms_px:.1f} {np.concatenate(squares).mean():.2f}"


def print_table(name: str, columns: dict[str, tuple[Look, float]], images: int) -> None:
    print(f"\n| {name} | " + " | ".join(columns) + " |\n" + "|---" * (len(columns) + 1) + "|")
    for radius_px in RADII_PX:
        entries = (entry(radius_px, look, blur_px, images) for look, blur_px in columns.values())
        print(f"| {radius_px:g} | " + " | ".join(entries) + " |", flush=True)


def shot(noise: float, *, is_dark: bool) -> Look:
    """Noise that is a third read noise at the middle level, and shot noise for the rest."""
    ground, dot = (HIGH, LOW) if is_dark else (LOW, HIGH)
    read = noise / 3.0
    grows = (noise**2 - read**2) / (0.5 * (LOW + HIGH))
    return Look(ground=ground, dot=dot, read_noise=read, shot_noise=grows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--images", type=int, default=12, help="of each entry (default: 12)")
    images = parser.parse_args().images
    even = {f"noise {noise:g}": (Look(ground=LOW, dot=HIGH, read_noise=noise), 0.8) for noise in NOISES}
    grown = {
        f"{'dark' if is_dark else 'light'}, {noise:g}": (shot(noise, is_dark=is_dark), 0.8)
        for is_dark in (False, True)
        for noise in NOISES[1:]
    }
    print_table("radius, px", even | grown, images)
    blurred = {
        f"blur {blur_px:g}, noise {noise:g}": (Look(ground=LOW, dot=HIGH, read_noise=noise), blur_px)
        for blur_px in BLURS_PX
        for noise in NOISES[:2]
    }
    print_table("radius, px", blurred, images)


if __name__ == "__main__":
    main()

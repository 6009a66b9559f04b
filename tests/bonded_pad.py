"""A pad bonded to a window, and the closed form of the layer that it is far from its sides."""

from dataclasses import replace

import numpy as np

from manytouch.evaluation.suite.pads.pad_sensors import pad_sensor as bonded_sensor
from manytouch.geometry.refraction import project_through_window
from manytouch.values import Sensor

THICKNESS_MM, POISSON, YOUNG_MPA = 4.0, 0.48, 0.3


def pad_sensor(**changed: object) -> Sensor:
    """63 dark dots every 2 mm on a pad of 25 x 21 x 4 mm behind a window; `changed` are of its sheet."""
    sensor = bonded_sensor(
        "pad",
        size_mm=(25.0, 21.0),
        thickness_mm=THICKNESS_MM,
        young_MPa=YOUNG_MPA,
        poisson=POISSON,
        marker_depth_mm=0.5,
        rows=7,
        columns=9,
        pitch_mm=2.0,
        width_px=320,
        centre_noise_px=0.02,
    )
    assert sensor.sheet is not None
    return replace(sensor, sheet=replace(sensor.sheet, **changed))  # type: ignore[arg-type]


def seen_px(sensor: Sensor, displacement_mm: np.ndarray | float = 0.0) -> np.ndarray:
    """(m, 2) images of the markers, moved by (m, 3)."""
    assert sensor.layout is not None
    assert sensor.sheet is not None
    return project_through_window(sensor.camera, sensor.sheet, sensor.layout.rest_mm + displacement_mm)


def layer_face(k: np.ndarray, thickness_mm: float, poisson: float) -> tuple[np.ndarray, ...]:
    """Closed form on the face of a layer with E = 1: across, along, normal, squeezed (R. Merkel 2007)."""
    shear, q = 0.5 / (1.0 + poisson), k * thickness_mm
    s, c = np.sinh(q), np.cosh(q)
    below = (3.0 - 4.0 * poisson) * c**2 + q**2 + (1.0 - 2.0 * poisson) ** 2
    own = (3.0 - 4.0 * poisson) * s * c
    coupling = (q**2 - (1.0 - 2.0 * poisson) * (3.0 - 4.0 * poisson) * s**2) / (2.0 * below)
    return (
        np.tanh(q) / (shear * k),
        (1.0 - poisson) * (own + q) / below / (shear * k),
        (1.0 - poisson) * (own - q) / below / (shear * k),
        coupling / (shear * k),
    )


def gaussian_on_layer(point_mm: np.ndarray, root_mm: float, *, is_shear: bool) -> np.ndarray:
    """(k, 3) displacement of the face by a Gaussian traction of unit force along z or x, by Fourier sums."""
    count, wide_mm = 384, 96.0
    step_mm = wide_mm / count
    wave = 2.0 * np.pi * np.fft.fftfreq(count, step_mm)
    kx, ky = np.meshgrid(wave, wave, indexing="ij")
    k = np.hypot(kx, ky)
    k[0, 0] = 1e-9
    across, along, normal, squeezed = layer_face(np.minimum(k, 60.0 / THICKNESS_MM), THICKNESS_MM, POISSON)
    load = np.exp(-0.5 * (k * root_mm) ** 2) / wide_mm**2
    cx, cy = kx / k, ky / k
    cx[0, 0] = 1.0  # the mean displacement
    if is_shear:
        parts = ((along * cx**2 + across * cy**2), (along - across) * cx * cy, -1j * squeezed * cx)
    else:
        parts = (1j * squeezed * cx, 1j * squeezed * cy, normal)
    wave_at = np.exp(1j * (point_mm[:, 0, None, None] * kx + point_mm[:, 1, None, None] * ky))
    return np.stack([(wave_at * part * load).sum(axis=(1, 2)).real for part in parts], axis=-1)


def gaussian_points(centre_mm: tuple[float, float], root_mm: float) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 2) and weights (n,) of a Gaussian with unit sum."""
    along = root_mm * np.linspace(-5.0, 5.0, 81)
    place = np.stack(np.meshgrid(along, along, indexing="ij"), axis=-1).reshape(-1, 2)
    weight = np.exp(-0.5 * (place**2).sum(axis=1) / root_mm**2)
    return place + centre_mm, weight / weight.sum()

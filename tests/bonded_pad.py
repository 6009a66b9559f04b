"""A pad bonded to a window, and the closed form of the layer that it is far from its sides."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import beta, gamma, j0, j1, jv

from manytouch.evaluation.suite.pads.pad_sensors import pad_sensor as bonded_sensor
from manytouch.geometry.refraction import project_through_window
from manytouch.mechanics.pad.layer import layer_response
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


@dataclass(frozen=True)
class RigidFace:
    """A rigid flat disc that is pressed by 1 mm into a layer without sides, by small strains.

    Pressure and radial shear are sums of (1 - s^2)^(m - 1/2) and of s (1 - s^2)^(m - 1/2), m = 0 to 5, for
    the place s over the radius. Of all with one force, those of a rigid face do the least work.

    Attributes:
        radius_mm, thickness_mm, poisson: of the disc and the layer.
        sticks: whether the face does not slide on the layer, or without friction.
    """

    radius_mm: float
    thickness_mm: float
    poisson: float
    sticks: bool

    def _transforms(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Wave numbers, weights of their integral, and Hankel transforms (6, k) of pressures and shears."""
        place, weight = np.polynomial.legendre.leggauss(1500)
        wave = 150.0 / self.radius_mm * (0.5 * (place + 1.0)) ** 2
        step = 150.0 / self.radius_mm * 0.5 * (place + 1.0) * weight
        ka, order = wave * self.radius_mm, np.arange(6)[:, None] - 0.5
        scale = 2.0**order * gamma(order + 1.0) * self.radius_mm**2 / ka ** (order + 1.0)
        return wave, wave * step, scale * jv(order + 1.0, ka), scale * jv(order + 2.0, ka)

    def _shares(self) -> tuple[np.ndarray, np.ndarray]:
        """Shares (6,) of the pressures and of the shears."""
        wave, part, press, shear = self._transforms()
        layer = layer_response(wave, self.thickness_mm, self.poisson)
        press_press = (press * layer.normal * part) @ press.T
        shear_press = (shear * layer.squeezed * part) @ press.T
        shear_shear = (shear * layer.along * part) @ shear.T
        force = 0.5 * self.radius_mm**2 * beta(1.0, np.arange(6) + 0.5)
        if not self.sticks:
            return np.linalg.solve(press_press, force), np.zeros(6)
        work = np.block([[press_press, shear_press.T], [shear_press, shear_shear]])
        share = np.linalg.solve(work, np.concatenate([force, np.zeros(6)]))
        return share[:6], share[6:]

    @property
    def moments(self) -> tuple[float, float, float, float]:
        """Force over E, mm^2; root of the second moment, mm; mean of r^4 with unit moments; radial shear.

        The last is that of a patch with the same mean of the radial shear.
        """
        press, shear = self._shares()
        power = np.arange(6) + 0.5
        force, second, fourth = (press @ beta(order, power) for order in (1.0, 2.0, 3.0))
        root_mm = self.radius_mm * np.sqrt(0.5 * second / force)
        radial = float(shear @ beta(2.0, power) / second * root_mm / self.radius_mm)
        return (
            np.pi * self.radius_mm**2 * float(force),
            float(root_mm),
            4.0 * fourth * force / second**2,
            radial,
        )

    def displacement_mm(self, away_mm: np.ndarray, below_mm: float) -> np.ndarray:
        """(k, 3) of points at places (k, 2) from the axis, below the face."""
        wave, part, press, shear = self._transforms()
        layer = layer_response(wave, self.thickness_mm, self.poisson, below_mm)
        press_share, shear_share = self._shares()
        pressure, radial = press_share @ press * part, shear_share @ shear * part
        distance_mm = np.maximum(np.linalg.norm(away_mm, axis=1), 1e-9)
        phase = np.outer(distance_mm, wave)
        outwards = j1(phase) @ (layer.squeezed * pressure + layer.along * radial)
        down = j0(phase) @ (layer.normal * pressure + layer.lifted * radial)
        return np.column_stack([away_mm * (outwards / distance_mm)[:, None], -down])


def ball_on_layer(radius: float, poisson: float) -> tuple[float, float, float]:
    """A frictionless paraboloid on a layer of thickness 1, with a contact of a radius, by small strains.

    The pressure is a sum of (1 - r^2)^n, n = 1/2, 3/2, ..., 11/2, whose Hankel transforms are
    2^n G(n + 1) J_{n + 1}(k) / k^{n + 1}, fitted to the depth.

    Returns:
        Root of the second moment of the pressure, depth of the centre times E over the force, and mean of r^4
        with unit second moments.
    """
    power = np.arange(0.5, 6.0)
    wave = np.linspace(1e-3, 300.0, 30_000)
    response = layer_response(wave / radius, 1.0, poisson).normal
    transform = 2.0 ** power[:, None] * gamma(power + 1.0)[:, None] * jv(power[:, None] + 1.0, wave)
    transform *= response * wave / wave ** (power[:, None] + 1.0)
    r = np.linspace(0.0, 0.98, 30)
    depth = j0(np.outer(r, wave)) @ transform.T
    share = np.linalg.lstsq(np.column_stack([depth, np.ones(30)]), r**2, rcond=None)[0][:-1]
    force, second, fourth = (share @ beta(order, power + 1.0) for order in (1.0, 2.0, 3.0))
    return (
        float(radius * np.sqrt(0.5 * second / force)),
        float(depth[0] @ share * (wave[1] - wave[0]) / (np.pi * radius**2 * force)),
        float(4.0 * fourth * force / second**2),
    )

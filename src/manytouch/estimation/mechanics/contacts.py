"""From clusters of nodal forces to contacts with their deviations."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from manytouch.estimation.mechanics.force_clusters import Clusters
from manytouch.estimation.mechanics.sheet_model import SheetModel
from manytouch.geometry.camera import project
from manytouch.geometry.spline.patch import Nodal
from manytouch.mechanics.markers.images import Face
from manytouch.values import ESTIMATES, Contact, Phase
from manytouch.values.arrays import read_only

_AREA = ESTIMATES.index("area")
_CLAMP_THICKNESSES = 4.0
_FORCES = ("shear_x", "shear_y", "normal_force", "torque")
_RINGS = np.array(
    [[0.0, 0.0]]
    + [
        [share * np.cos(angle), share * np.sin(angle)]
        for share, count in ((0.4, 6), (0.8, 10))
        for angle in 2.0 * np.pi * np.arange(count) / count
    ]
)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ModelError:
    """What the model does not explain, in addition to the noise of the centres.

    Attributes:
        position_pitch: of a centre along each axis,
        position_radius: and in radii of the contact.
        position_clamp: four thicknesses from a clamped outline, across it, in thicknesses; e times as much a
            thickness nearer. A solid beside its clamp shears where the shell bends.
        depth_share, depth_pitch: of the depth of a contact, and in pitches.
        force_share, force_unit: of the normal force, and in force units.
        shear_share: of the normal force, along each axis.
        torque_share: of the normal force times the contact's radius.
        area_share, area_thickness2: of the area, and in squares of the thickness.
        nominal: all of it is so many times larger where the sheet was assumed.
    """

    position_pitch: float = 0.02
    position_radius: float = 0.05
    position_clamp: float = 0.1
    depth_share: float = 0.028
    depth_pitch: float = 0.002
    force_share: float = 0.07
    force_unit: float = 1.0e-3
    shear_share: float = 0.03
    torque_share: float = 0.1
    area_share: float = 0.15
    area_thickness2: float = 0.5
    nominal: float = 4.0

    def variances(
        self,
        model: SheetModel,
        centre_mm: np.ndarray,
        press_mm2: float,
        depth_mm: float,
        *,
        over_mm2: float,
        area_mm2: float,
    ) -> np.ndarray:
        """(8,) in the order of `ESTIMATES`, forces over E, of a contact at (2,)."""
        radius_mm = np.sqrt(over_mm2 / np.pi)
        place = np.hypot(self.position_pitch * model.pitch_mm, self.position_radius * radius_mm)
        beside = np.zeros(2)
        if model.patch.boundary == "clamped":
            inside_mm = 0.5 * np.array(model.patch.size_mm) - np.abs(centre_mm - model.patch.centre_mm)
            thicknesses = np.maximum(inside_mm / model.thickness_mm, 0.0)
            beside = self.position_clamp * model.thickness_mm * np.exp(_CLAMP_THICKNESSES - thicknesses)
        std = [
            *np.hypot(place, beside),
            np.hypot(self.depth_share * depth_mm, self.depth_pitch * model.pitch_mm),
            *(self.shear_share * press_mm2, self.shear_share * press_mm2),
            np.hypot(self.force_share * press_mm2, self.force_unit * model.lattice.force_unit_mm2),
            self.torque_share * press_mm2 * max(radius_mm, 0.5 * model.pitch_mm),
            np.hypot(self.area_share * area_mm2, self.area_thickness2 * model.thickness_mm**2),
        ]
        return np.asarray(np.square(std) * (self.nominal if model.is_nominal else 1.0) ** 2)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Touching:
    """Turns clusters into contacts; needs the last Gauss-Newton step to be that of their frame.

    Attributes:
        error: of the model.
    """

    error: ModelError = ModelError()

    def __call__(
        self,
        model: SheetModel,
        clusters: Clusters,
        coefficient_mm: Nodal,
        force_mm2: Nodal,
    ) -> list[Contact]:
        """Contacts without identity.

        Their depth is the shell's. Right under a narrow load a solid's face lies deeper (`solid_face`), but
        between the markers forces on nodes make the shell as much sharper.
        """
        if len(clusters) == 0:
            return []
        count = len(clusters)
        radius_mm = np.sqrt(np.maximum(clusters.area_mm2, (0.5 * model.pitch_mm) ** 2) / np.pi)
        around_mm = clusters.centre_mm[:, None] + radius_mm[:, None, None] * _RINGS
        face = Face(shell=model.shell, point_mm=around_mm.reshape(-1, 2))
        moved_mm = face.displacement(coefficient_mm).reshape(count, len(_RINGS), 3)
        deepest = np.argmin(moved_mm[:, :, 2], axis=1)
        here_mm = moved_mm[:, 0] + np.column_stack([clusters.centre_mm, np.zeros(count)])
        centre_px = project(model.camera, here_mm)
        slope = face.derivative(coefficient_mm)
        contacts = []
        for number in range(count):
            point = number * len(_RINGS) + int(deepest[number])
            rows = _rows(model, clusters, number, force_mm2)
            rows[2] = 0.0
            rows[2, face.basis.node[point]] = -slope[point, 2]
            noise = model.normal.covariance(rows)
            depth_mm = -float(moved_mm[number, deepest[number], 2])
            contacts.append(
                self._contact(model, clusters, number, depth_mm=depth_mm, centre_px=centre_px, noise=noise)
            )
        return contacts

    def _contact(
        self,
        model: SheetModel,
        clusters: Clusters,
        number: int,
        *,
        depth_mm: float,
        centre_px: np.ndarray,
        noise: Float64[np.ndarray, "8 8"],
    ) -> Contact:
        press_mm2, area_mm2 = float(clusters.normal_mm2[number]), float(clusters.patch_mm2[number])
        over_mm2 = float(clusters.area_mm2[number])
        variance = self.error.variances(
            model,
            clusters.centre_mm[number],
            press_mm2,
            depth_mm,
            over_mm2=over_mm2,
            area_mm2=area_mm2,
        )
        if np.isfinite(clusters.place_mm2[number]).all():
            eased = np.ones(len(ESTIMATES))
            eased[:2] = np.sqrt(np.diag(clusters.place_mm2[number]) / np.maximum(np.diag(noise)[:2], 1e-12))
            noise = noise * np.outer(eased, eased)
        covariance = noise + np.diag(variance)
        covariance[_AREA, _AREA] += clusters.patch_std_mm2[number] ** 2
        if np.isnan(area_mm2):
            covariance[_AREA, :] = covariance[:, _AREA] = np.nan
        young_MPa = np.nan if model.young_MPa is None else model.young_MPa
        is_force = np.array([name in _FORCES for name in ESTIMATES])
        unit = np.where(is_force, young_MPa, 1.0)
        # Whatever is wrong with E is wrong with all forces alike.
        scaled = np.zeros(len(ESTIMATES))
        scaled[is_force] = model.young_share * np.array(
            [*clusters.force_mm2[number, :2], press_mm2, clusters.torque_mm3[number]]
        )
        covariance = covariance + np.outer(scaled, scaled)
        return Contact(
            id=-1,
            phase=Phase.MOVE,
            centre_mm=read_only(clusters.centre_mm[number].copy()),
            centre_px=read_only(centre_px[number].copy()),
            depth_mm=depth_mm,
            force_N=read_only(young_MPa * clusters.force_mm2[number]),
            torque_Nmm=float(young_MPa * clusters.torque_mm3[number]),
            area_mm2=area_mm2,
            covariance=read_only(covariance * np.outer(unit, unit)),
            normal_force_over_E_mm2=press_mm2,
            shear_over_E_mm2=(float(clusters.force_mm2[number, 0]), float(clusters.force_mm2[number, 1])),
        )


def _rows(model: SheetModel, clusters: Clusters, number: int, force_mm2: Nodal) -> np.ndarray:
    """(8, n, 3) derivatives of the estimates by the coefficients; those of depth and area are left out."""
    inside = clusters.label == number
    arm = np.where(inside[:, None], model.lattice.place_mm - clusters.centre_mm[number], 0.0)
    press_mm2 = clusters.normal_mm2[number]
    share = (inside & (force_mm2[:, 2] < 0.0)).astype(np.float64)
    row = model.normal.force_row
    return np.stack(
        [
            row(-share * arm[:, 0] / press_mm2, 2),
            row(-share * arm[:, 1] / press_mm2, 2),
            np.zeros_like(force_mm2),
            row(inside.astype(np.float64), 0),
            row(inside.astype(np.float64), 1),
            row(-share, 2),
            row(arm[:, 0], 1) - row(arm[:, 1], 0),
            np.zeros_like(force_mm2),
        ]
    )

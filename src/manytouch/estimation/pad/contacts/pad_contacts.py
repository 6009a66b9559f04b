"""Shape of a pad and contacts with deviations, from fitted patches."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float64

from manytouch.estimation.mechanics.clusters.force_clusters import Clusters
from manytouch.estimation.mechanics.regions.contact_values import contact_of
from manytouch.estimation.mechanics.regions.footprints import Footprint, Footprints
from manytouch.estimation.mechanics.regions.outlines import polygon_area, within_rectangle
from manytouch.estimation.pad.contacts.contact_depth import ContactDepth, contact_depth
from manytouch.estimation.pad.contacts.pad_shape import PadShape
from manytouch.estimation.pad.pad_model import MOTIONS, BondedPadModel
from manytouch.estimation.pad.patch_fit import PadFit, misfit_scale
from manytouch.estimation.pad.patch_forces import (
    FORCE,
    PARAMETER_COUNT,
    RADIAL_SHEAR,
    SHEAR_X,
    SHEAR_Y,
    TORQUE,
)
from manytouch.estimation.pad.patch_kernels import (
    CENTRE_X,
    CENTRE_Y,
    ROOT_XX,
    SHAPE,
    Profile,
)
from manytouch.geometry.refraction import project_through_window
from manytouch.medians import median
from manytouch.values import ESTIMATES, Contact
from manytouch.values.arrays import Covariances3, Mask, read_only

_AREA, _DEPTH, _NORMAL = (ESTIMATES.index(name) for name in ("area", "depth", "normal_force"))
_FORCES = [ESTIMATES.index(name) for name in ("shear_x", "shear_y", "normal_force", "torque")]


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PadContacts:
    """Computes contacts from fitted patches.

    Attributes:
        footprints: regions of the contacts.
        position_pitch: standard deviation of a centre along each axis that the model does not explain, in
            pitches.
        position_root: standard deviation of a centre along each axis that the model does not explain, over
            the square root of the trace of the contact's second moment.
        depth_share: standard deviation of the depth that the model does not explain, over the depth.
        depth_pitch: standard deviation of the depth that the model does not explain, in pitches.
        dragged_face: standard deviation of the depth of a flat face over its depth, where its shear, or its
            torque over the radius, is as large as its normal force; proportional to them. The shear of a face
            that sticks is larger near its rim than that of one that slides, so that the face is estimated too
            wide and not deep enough. Chosen for two presses with shears of .38 and .40 of the normal force;
            the depth of two that turned was off by half as much.
        force_share: standard deviation of the normal force that the model does not explain, over the normal
            force.
        stiffening: by how much the normal force of an object that slides exceeds that of the linear pad, over
            the latter, where the depth is one thickness; proportional to the depth. Chosen for the least mean
            error over 3-D solutions with depths of up to .4 thicknesses and Poisson's ratios of .47 to .49,
            of which sliding balls alone need 0, and edges .8.
        sticking: by how much the normal force of an object that sticks exceeds it in addition, since such an
            object hinders the pad from spreading. Chosen in the same way on eight presses with friction, and
            not confirmed on other ones.
        sticking_power: the normal force of a flat face that sticks, over that of the linear pad, is
            1 / (1 - depth / thickness) to this power, that of a thin incompressible pad
            (docs/derivations/bonded-pads.md).
        sticking_shear: an object slides if its radial shear is above the first number, and sticks if it is
            below the second one; between them the force is interpolated.
        large_strain: standard deviation of depth and normal force by large strains, over their values, where
            the depth is one thickness; proportional to the depth.
        wide: standard deviation of depth and normal force of wide contacts, over their values, where the mean
            of the two principal second moments is the squared thickness; proportional to this mean. Markers
            hardly show the pressure in the middle of a wide contact.
        shear_share: standard deviation of the shear along each axis, over the normal force.
        torque_share: standard deviation of the torque, over the normal force times the square root of the
            trace of the contact's second moment.
        area_share: standard deviation of the area that the model does not explain, over the area.
        most_depth_std: a depth with a larger standard deviation is not known (NaN), in thicknesses. A depth
            lies between 0 and the thickness, so that a deviation of half a thickness means that nothing is
            known about it.
    """

    footprints: Footprints = field(default_factory=Footprints)
    position_pitch: float = 0.02
    position_root: float = 0.08
    depth_share: float = 0.12
    depth_pitch: float = 0.002
    dragged_face: float = 0.5
    force_share: float = 0.05
    stiffening: float = 0.35
    sticking: float = 0.6
    sticking_power: float = 1.5
    sticking_shear: tuple[float, float] = (-0.06, -0.16)
    large_strain: float = 0.3
    wide: float = 0.8
    shear_share: float = 0.02
    torque_share: float = 0.05
    area_share: float = 0.25
    most_depth_std: float = 0.5

    def __call__(self, model: BondedPadModel, fit: PadFit, shape: PadShape) -> list[Contact]:
        """Contacts of a fit, without identity (id -1)."""
        if len(fit.patches) == 0:
            return []
        clusters = _clusters(model, fit)
        return [self._contact(model, fit, shape, clusters, number) for number in range(len(fit.patches))]

    def _unexplained(self, share: float, strain: float, width: float) -> float:
        """Relative deviation that the model does not explain, for lengths in thicknesses."""
        return float(np.linalg.norm((share, self.large_strain * strain, 0.5 * self.wide * width**2)))

    def _stiffening(self, radial: float, profile: int, strain: float) -> tuple[float, float, float]:
        """Normal force over that of the linear pad; its derivatives by the strain and by the radial shear.

        The strain is the depth in thicknesses. The radial shear shows how far the object slides or sticks.
        """
        slides, sticks = self.sticking_shear
        share = (radial - slides) / (sticks - slides)
        share_slope = float(0.0 < share < 1.0) / (sticks - slides)
        share = min(max(share, 0.0), 1.0)
        sliding = 1.0 + self.stiffening * strain
        sticking, sticking_slope = sliding + self.sticking * strain, self.stiffening + self.sticking
        if profile == Profile.FLAT:
            left, power = max(1.0 - strain, 0.5), self.sticking_power  # deeper, the force is not known
            sticking, sticking_slope = left**-power, power * left ** (-power - 1.0)
        by_strain = (1.0 - share) * self.stiffening + share * sticking_slope
        return (1.0 - share) * sliding + share * sticking, by_strain, share_slope * (sticking - sliding)

    def surface_covariance(
        self, model: BondedPadModel, fit: PadFit, found: Sequence[Contact], shape: PadShape, is_seen: Mask
    ) -> Covariances3:
        """(m, 3, 3) covariances of the contact face over the markers, mm^2.

        The displacement has the relative deviation of the depth of the strongest of the contacts `found`.
        """
        noise_mm = model.pitch_mm / model.pitch_px * _noise_px(fit)
        share = self.depth_share
        if found:
            strongest = max(found, key=lambda contact: contact.normal_force_over_E_mm2)
            known = strongest.std("depth") / max(strongest.depth_mm, 1e-9)
            share = known if np.isfinite(known) else 1.0
        growth = np.where(is_seen, 1.0, 2.0)[:, None]
        std_mm = growth * np.hypot(noise_mm, share * np.abs(shape.face_mm))
        covariance = np.zeros((len(std_mm), 3, 3))
        covariance[:, range(3), range(3)] = std_mm**2
        return covariance

    def _contact(
        self, model: BondedPadModel, fit: PadFit, shape: PadShape, clusters: Clusters, number: int
    ) -> Contact:
        parameters, profile = fit.patches.parameters[number], int(fit.patches.profile[number])
        deepest = contact_depth(model, fit, shape, number)
        depth_mm, centre_mm = deepest.depth_mm, parameters[:2]
        strain = max(depth_mm, 0.0) / model.thickness_mm
        factor, by_strain, by_radial = self._stiffening(float(parameters[RADIAL_SHEAR]), profile, strain)
        press_mm2 = factor * float(parameters[FORCE])
        slope = _slopes(deepest)
        slope[_NORMAL] *= factor
        slope[_NORMAL] += parameters[FORCE] * by_strain / model.thickness_mm * slope[_DEPTH]
        slope[_NORMAL, RADIAL_SHEAR] += parameters[FORCE] * by_radial
        covariance = _fitted_covariance(fit, number, slope)
        footprint = _on_pad(self.footprints(clusters, number, model.pitch_mm), model)
        std = self._model_std(model, parameters, profile, depth_mm=depth_mm, press_mm2=press_mm2)
        covariance += np.diag(std**2)
        covariance[_AREA, _AREA] = footprint.area_std_mm2**2 + (self.area_share * footprint.area_mm2) ** 2
        if covariance[_DEPTH, _DEPTH] > (self.most_depth_std * model.thickness_mm) ** 2:
            depth_mm = np.nan
            covariance[_DEPTH, :] = covariance[:, _DEPTH] = np.nan
        # errors of E and of the scale of the image change all forces alike
        common = np.zeros(len(ESTIMATES))
        common[_FORCES] = parameters[SHEAR_X], parameters[SHEAR_Y], press_mm2, parameters[TORQUE]
        covariance = covariance + (model.young_std**2 + model.scale_std**2) * np.outer(common, common)
        face_mm = np.array([*centre_mm, model.sheet.marker_depth_mm or 0.0]) + deepest.centre_mm
        return contact_of(
            footprint,
            covariance,
            centre_mm=centre_mm,
            centre_px=project_through_window(model.camera, model.sheet, face_mm[None])[0],
            depth_mm=depth_mm,
            force_mm2=np.array([parameters[SHEAR_X], parameters[SHEAR_Y], -press_mm2]),
            torque_mm3=float(parameters[TORQUE]),
            young_MPa=model.young_MPa,
        )

    def _model_std(
        self,
        model: BondedPadModel,
        parameters: Float64[np.ndarray, "10"],
        profile: int,
        *,
        depth_mm: float,
        press_mm2: float,
    ) -> Float64[np.ndarray, "8"]:
        """Standard deviations of `ESTIMATES` by errors of the model, forces over E; 0 for the area."""
        root_trace_mm = float(np.linalg.norm(parameters[ROOT_XX:SHAPE]))
        strain, width = max(depth_mm, 0.0) / model.thickness_mm, root_trace_mm / model.thickness_mm
        std = np.zeros(len(ESTIMATES))
        std[:2] = np.hypot(self.position_pitch * model.pitch_mm, self.position_root * root_trace_mm)
        depth_share = self._unexplained(self.depth_share, strain, width)
        if profile == Profile.FLAT:
            dragged_mm2 = np.hypot(*parameters[SHEAR_X:TORQUE]) + abs(parameters[TORQUE]) / root_trace_mm
            depth_share = np.hypot(depth_share, self.dragged_face * dragged_mm2 / max(press_mm2, 1e-9))
        std[_DEPTH] = np.hypot(depth_share * depth_mm, self.depth_pitch * model.pitch_mm)
        std[_FORCES] = (
            self.shear_share * press_mm2,
            self.shear_share * press_mm2,
            press_mm2 * self._unexplained(self.force_share, strain, width),
            self.torque_share * press_mm2 * root_trace_mm,
        )
        return std


def _slopes(deepest: ContactDepth) -> Float64[np.ndarray, "8 p"]:
    """Derivatives of `ESTIMATES` of a linear pad by the parameters of a contact, then by those of the pad.

    Those of the area are 0.
    """
    slope = np.zeros((len(ESTIMATES), len(deepest.by_parameter)))
    slope[_DEPTH] = deepest.by_parameter
    for parameter, estimate in enumerate(("normal_force", "shear_x", "shear_y", "torque"), FORCE):
        slope[ESTIMATES.index(estimate), parameter] = 1.0
    slope[0, CENTRE_X] = slope[1, CENTRE_Y] = 1.0
    return slope


def _fitted_covariance(
    fit: PadFit, number: int, slope: Float64[np.ndarray, "8 p"]
) -> Float64[np.ndarray, "8 8"]:
    """Covariance of `ESTIMATES` of a contact by noise, priors and the parameters of the pad."""
    part = np.r_[
        PARAMETER_COUNT * number : PARAMETER_COUNT * (number + 1),
        PARAMETER_COUNT * len(fit.patches) + MOTIONS : len(fit.covariance),
    ]
    covariance = misfit_scale(fit) * slope @ fit.covariance[np.ix_(part, part)] @ slope.T
    by_sheet = slope @ fit.by_sheet[part]
    covariance += by_sheet @ by_sheet.T
    return np.asarray(covariance)


def _on_pad(footprint: Footprint, model: BondedPadModel) -> Footprint:
    """The footprint without what is beyond the outline of the pad."""
    low_mm = np.asarray(model.patch.corner_mm)
    high_mm = low_mm + np.asarray(model.patch.size_mm)
    rings = []
    for ring in footprint.outline:
        inside = ((low_mm <= ring.point_mm) & (ring.point_mm <= high_mm)).all()
        point_mm = ring.point_mm if inside else within_rectangle(ring.point_mm, low_mm, high_mm)
        if len(point_mm) > 2:
            rings.append(replace(ring, point_mm=read_only(point_mm)))
    area_mm2 = [abs(polygon_area(ring.point_mm)) * (-1.0 if ring.is_hole else 1.0) for ring in rings]
    return replace(footprint, outline=tuple(rings), area_mm2=min(float(np.sum(area_mm2)), footprint.area_mm2))


def _noise_px(fit: PadFit) -> float:
    """Median standard deviation of the marker images of a frame."""
    return float(1.0 / np.sqrt(median(fit.weight[fit.weight > 0.0])))


def _clusters(model: BondedPadModel, fit: PadFit) -> Clusters:
    """The patches as what `Footprints` computes regions of."""
    count = len(fit.patches)
    spread, covariance = np.empty((count, 2, 2)), np.empty((count, 6, 6))
    scale = misfit_scale(fit)
    order = [FORCE, *range(SHAPE)]
    for number, (xx, yx, yy) in enumerate(fit.patches.parameters[:, ROOT_XX:SHAPE]):
        spread[number] = [[xx * xx, xx * yx], [xx * yx, yx * yx + yy * yy]]
        change = np.eye(6)
        change[3:, 3:] = [[2.0 * xx, 0.0, 0.0], [yx, xx, 0.0], [0.0, 2.0 * yx, 2.0 * yy]]
        at = PARAMETER_COUNT * number + np.array(order)
        covariance[number] = scale * change @ fit.covariance[np.ix_(at, at)] @ change.T
    clusters = Clusters.of_forces(
        centre_mm=fit.patches.parameters[:, :2],
        force_mm2=np.column_stack([fit.patches.parameters[:, SHEAR_X:TORQUE], -fit.force_mm2]),
        torque_mm3=fit.patches.parameters[:, TORQUE],
        spread_mm2=spread,
        label=np.full(model.patch.node_count, -1, dtype=np.int64),
    )
    return replace(clusters, covariance=covariance)

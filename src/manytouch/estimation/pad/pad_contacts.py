"""Shape of a pad and contacts with deviations, from fitted patches."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float64, Int64

from manytouch.compilation import kernel, no_type_check
from manytouch.estimation.mechanics.clusters.force_clusters import Clusters
from manytouch.estimation.mechanics.regions.footprints import Footprint, Footprints
from manytouch.estimation.mechanics.regions.outlines import polygon_area, within_rectangle
from manytouch.estimation.pad.pad_model import MOTIONS, BondedPadModel
from manytouch.estimation.pad.patch_fit import PadFit, forced, misfit_scale
from manytouch.estimation.pad.patch_forces import (
    FORCE,
    PARAMETER_COUNT,
    RADIAL_SHEAR,
    SHEAR_X,
    SHEAR_Y,
    TORQUE,
    fill_basis,
    fill_effects,
    pressing_work,
)
from manytouch.estimation.pad.patch_kernels import (
    CENTRE_X,
    CENTRE_Y,
    ROOT_XX,
    ROOT_YX,
    ROOT_YY,
    SHAPE,
    Profile,
)
from manytouch.geometry.refraction import project_through_window
from manytouch.geometry.spline.patch import Nodal
from manytouch.medians import median
from manytouch.values import ESTIMATES, Contact, Phase
from manytouch.values.arrays import Covariances3, Mask, Points2, Points3, Scalars, read_only, read_only_view

_AREA, _DEPTH, _NORMAL = (ESTIMATES.index(name) for name in ("area", "depth", "normal_force"))
_FORCES = [ESTIMATES.index(name) for name in ("shear_x", "shear_y", "normal_force", "torque")]
_STEP_MM = 1e-3  # of the shape of a contact, in differences of its depth
_ELEMENT_ROOT = 0.245  # so that the depth under a Gaussian load of .75 elements agrees with the layer
_CENTRE_DEPTH = (8.0 / 3.0 / np.sqrt(6.0), 0.5 * np.pi / np.sqrt(3.0), np.sqrt(0.5))
"""Depth of the centre of a patch on a half-space, of a flat one that of a rigid flat face, over
(1 - nu^2) F / (pi E) and the root of its second moment."""
_RING_ROOTS = (1.0, 1.0, np.sqrt(2.0))
"""Radius at which a dome or a rim may be deeper than at its centre, in roots of its second moment."""
_STICKING_ROOTS = (2.0, np.sqrt(7.0 / 3.0), 0.0)
"""Radius at which the mean lateral displacement by a patch of each profile is that of a rigid object that
sticks and has the same shear, in roots of its second moment; 0 for a rim, inside which it is nearly
constant."""
_RING = np.array([[0.0, 0.0]] + [[np.cos(angle), np.sin(angle)] for angle in 2.0 * np.pi * np.arange(8) / 8])


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class PadShape:
    """The pad in a frame.

    Attributes:
        nodal_mm2: (n, 3) nodal forces over E.
        coefficient_mm: (n, 3) of the displacement of the contact face.
        linear_mm: (n, 3) the same without `large_strain`.
        face_mm: (m, 3) displacement of the contact face over each marker.
    """

    nodal_mm2: Nodal
    coefficient_mm: Nodal
    linear_mm: Nodal
    face_mm: Points3


@kernel()
@no_type_check
def large_strain(depth_mm: Scalars, thickness_mm: float) -> Scalars:
    """Depth of a pad under the load that gives a linear one this depth.

    A pad stiffens as it becomes thinner. Logarithmic strain, h (1 - exp(-d / h)), is below it, a
    neo-Hookean column with (l^-2 - l) / 3 = d / h for its stretch l above it; their mean is within 3 % of 3-D
    solutions for a ball with the radius of the thickness, to depths of .4 thicknesses.
    """
    pressed = depth_mm.copy()
    for k in range(len(depth_mm)):
        if not depth_mm[k] > 0.0:
            continue
        strain = min(depth_mm[k] / thickness_mm, 10.0)  # what is deeper has no more meaning
        logarithmic = stretch = np.exp(-strain)
        for _ in range(6):  # Newton's method
            off = (stretch**-2 - stretch) / 3.0 - strain
            stretch += off / ((2.0 * stretch**-3 + 1.0) / 3.0)
        pressed[k] = thickness_mm * (1.0 - 0.5 * (logarithmic + stretch))
    return pressed


def pad_shape(model: BondedPadModel, fit: PadFit) -> PadShape:
    """The pad under fitted patches."""
    nodal_mm2 = fit.nodal_mm2(model)
    node = np.flatnonzero(nodal_mm2.any(axis=1))
    linear_mm = forced(nodal_mm2, model.face)
    by_parameter = nodal_mm2[node, 2] @ model.depth_by_parameter[:, node]  # symmetric
    linear_mm[:, 2] += fit.sheet[: len(by_parameter)] @ by_parameter
    coefficient_mm = linear_mm.copy()
    coefficient_mm[:, 2] = -large_strain(-coefficient_mm[:, 2], model.thickness_mm)
    return PadShape(
        nodal_mm2=nodal_mm2,
        coefficient_mm=coefficient_mm,
        linear_mm=linear_mm,
        face_mm=model.over_marker.displacement(coefficient_mm),
    )


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
        dragged_face: standard deviation of the depth of a flat face over it, where its shear and turn are as
            large as its normal force; proportional to them. A face that sticks has them nearer to its rim
            than one that slides, and then looks wider and less deep. Chosen for two presses with shears of
            .38 and .40 of the force; two that turned lost half as much.
        force_share: standard deviation of the normal force that the model does not explain, over it.
        stiffening: by how much the normal force of a large strain exceeds that of the linear pad, over it,
            where the depth is one thickness; proportional to it. Chosen for the least mean error over 3-D
            solutions, depths to .4 thicknesses, Poisson's ratio .47 to .49: sliding balls need 0, edges .8.
        sticking: by how much more it exceeds that under an object that sticks, which hinders the pad from
            spreading; chosen likewise, on eight presses with friction, and not confirmed on held-out ones.
        sticking_power: of 1 / (1 - depth / thickness) in the force of a flat face that sticks over that of
            the linear pad: that of a thin incompressible pad (docs/derivations/bonded-pads.md).
        sticking_shear: radial shear up to which an object slides, and from which on it sticks.
        large_strain: standard deviation of depth and normal force by large strains, over their values, where
            the depth is one thickness; proportional to the depth.
        wide: standard deviation of depth and normal force of wide contacts, over their values, where the mean
            of the two principal second moments is the squared thickness; proportional to this mean. Markers
            hardly show the pressure in the middle of a wide contact.
        shear_share: standard deviation of the shear along each axis, over the normal force.
        torque_share: standard deviation of the torque, over the normal force times the square root of the
            trace of the contact's second moment.
        area_share: standard deviation of the area that the model does not explain, over the area.
        most_depth_std: largest standard deviation of a depth, in thicknesses; beyond, the depth is unknown.
            A depth lies between 0 and the thickness, so that nothing is known about one with half of it.
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

    def _stiffer(self, radial: float, profile: int, strain: float) -> tuple[float, float, float]:
        """Force over that of the linear pad, and its derivatives by the strain and by the radial shear."""
        slides, sticks = self.sticking_shear
        share, slid = (radial - slides) / (sticks - slides), 1.0 + self.stiffening * strain
        by_radial, share = float(0.0 < share < 1.0) / (sticks - slides), min(max(share, 0.0), 1.0)
        stuck, steep, left = slid + self.sticking * strain, self.stiffening + self.sticking, 1.0 - strain
        if profile == Profile.FLAT:
            left, power = max(left, 0.5), self.sticking_power  # beyond, nothing is known
            stuck, steep = left**-power, power * left ** (-power - 1.0)
        factor = (1.0 - share) * slid + share * stuck
        return factor, (1.0 - share) * self.stiffening + share * steep, by_radial * (stuck - slid)

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
        parameters = fit.patches.parameters[number]
        depth_mm, slope, moved_mm = _depth(model, fit, shape, number)
        strain, profile = max(depth_mm, 0.0) / model.thickness_mm, int(fit.patches.profile[number])
        stiffer, by_strain, by_radial = self._stiffer(float(parameters[RADIAL_SHEAR]), profile, strain)
        centre_mm, press_mm2 = parameters[:2], stiffer * float(parameters[FORCE])
        slope[_NORMAL] *= stiffer
        slope[_NORMAL] += parameters[FORCE] * by_strain / model.thickness_mm * slope[_DEPTH]
        slope[_NORMAL, RADIAL_SHEAR] += parameters[FORCE] * by_radial
        part = np.r_[
            PARAMETER_COUNT * number : PARAMETER_COUNT * (number + 1),
            PARAMETER_COUNT * len(fit.patches) + MOTIONS : len(fit.covariance),
        ]
        covariance = misfit_scale(fit) * slope @ fit.covariance[np.ix_(part, part)] @ slope.T
        by_sheet = slope @ fit.by_sheet[part]
        covariance += by_sheet @ by_sheet.T
        footprint = _on_pad(self.footprints(clusters, number, model.pitch_mm), model)
        area_mm2 = footprint.area_mm2
        root_trace_mm = float(np.linalg.norm(parameters[ROOT_XX:SHAPE]))
        std, width = np.zeros(len(ESTIMATES)), root_trace_mm / model.thickness_mm
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
        covariance += np.diag(std**2)
        covariance[_AREA, _AREA] = footprint.area_std_mm2**2 + (self.area_share * area_mm2) ** 2
        is_unclear = bool(covariance[_AREA, _AREA] > area_mm2**2)
        if is_unclear:
            area_mm2 = np.nan
            covariance[_AREA, :] = covariance[:, _AREA] = np.nan
        if covariance[_DEPTH, _DEPTH] > (self.most_depth_std * model.thickness_mm) ** 2:
            depth_mm = np.nan
            covariance[_DEPTH, :] = covariance[:, _DEPTH] = np.nan
        common = np.zeros(len(ESTIMATES))
        common[_FORCES] = parameters[SHEAR_X], parameters[SHEAR_Y], press_mm2, parameters[TORQUE]
        covariance = covariance + (model.young_std**2 + model.scale_std**2) * np.outer(common, common)
        young_MPa = np.nan if model.young_MPa is None else model.young_MPa
        unit = np.ones(len(ESTIMATES))
        unit[_FORCES] = young_MPa
        face_mm = np.array([*centre_mm, model.sheet.marker_depth_mm or 0.0]) + moved_mm
        centre_px = project_through_window(model.camera, model.sheet, face_mm[None])[0]
        return Contact(
            id=-1,
            phase=Phase.MOVE,
            centre_mm=read_only(centre_mm.copy()),
            centre_px=read_only(centre_px),
            depth_mm=depth_mm,
            force_N=read_only(young_MPa * np.array([parameters[SHEAR_X], parameters[SHEAR_Y], -press_mm2])),
            torque_Nmm=float(young_MPa * parameters[TORQUE]),
            area_mm2=area_mm2,
            covariance=read_only(covariance * np.outer(unit, unit)),
            normal_force_over_E_mm2=press_mm2,
            shear_over_E_mm2=(float(parameters[SHEAR_X]), float(parameters[SHEAR_Y])),
            half_major_mm=footprint.half_major_mm,
            half_minor_mm=footprint.half_minor_mm,
            orientation_rad=footprint.orientation_rad,
            shape=footprint.shape,
            shape_probability=footprint.shape_probability,
            outline=None if is_unclear else footprint.outline,
        )


def _depth(
    model: BondedPadModel, fit: PadFit, shape: PadShape, number: int
) -> tuple[float, Float64[np.ndarray, "8 p"], Float64[np.ndarray, "3"]]:
    """Largest depth of a contact; derivatives of `ESTIMATES`; displacement of its centre.

    A rigid flat face is everywhere as deep as the work of its traction over its force (E. Betti 1872).
    The derivatives are by the parameters of the contact, then by those of the pad. Areas have none.
    An object that sticks moves the face by the mean displacement of a shear like the pressure, weighted with
    its own, 1 / sqrt(a^2 - r^2) on a disc on a half-space: to second order, that at r = sqrt(2 / 3) a.
    """
    parameters, profile = read_only_view(fit.patches.parameters)[number], int(fit.patches.profile[number])
    root = np.array([[parameters[ROOT_XX], 0.0], [parameters[ROOT_YX], parameters[ROOT_YY]]])
    rings = np.concatenate([_RING_ROOTS[profile] * _RING, _STICKING_ROOTS[profile] * _RING[1:]])
    node, value = _basis(model, parameters[:2] + rings @ root.T)
    moved_mm = np.einsum("kn,kni->ki", value, shape.coefficient_mm[node])
    deepest = int(np.argmin(moved_mm[: len(_RING), 2]))
    centre_mm = np.array([*moved_mm[len(_RING) :, :2].mean(axis=0), moved_mm[0, 2]])
    is_face, press_mm2 = profile == Profile.FLAT, max(float(parameters[FORCE]), 1e-9)
    moved_by = model.by_place(shape.linear_mm) / press_mm2
    linear_mm = pressing_work(parameters, profile, model.grid, moved_by)  # compiled with any first contact
    if is_face:
        deepest, effect = 0, 2.0 * moved_by
    else:  # the face is symmetric
        linear_mm = -float(value[deepest] @ shape.linear_mm[node[deepest], 2])
        by_node = (value[deepest] @ model.face[node[deepest], 2].reshape(16, -1)).reshape(-1, 3)
        effect = -model.by_place(by_node)
    slope = np.zeros((len(ESTIMATES), PARAMETER_COUNT + len(fit.sheet)))
    step = np.full(PARAMETER_COUNT, _STEP_MM)
    step[SHAPE:] = 1e-3 * max(abs(float(parameters[FORCE])), 1e-9)
    fill_effects(parameters, profile, model.grid, effect, slope[_DEPTH, :PARAMETER_COUNT])
    slope[_DEPTH, FORCE] -= linear_mm / press_mm2 if is_face else 0.0
    linear_mm += (plain_mm := _unresolved_depth(model, parameters, profile) if deepest == 0 else 0.0)
    depth_mm = float(large_strain(np.array([linear_mm]), model.thickness_mm)[0])
    # what is not resolved depends on these parameters only
    for parameter in (ROOT_XX, ROOT_YY, FORCE) if deepest == 0 else ():
        changed = parameters.copy()
        changed[parameter] += step[parameter]
        slope[_DEPTH, parameter] += (_unresolved_depth(model, changed, profile) - plain_mm) / step[parameter]
    around = model.depth_by_parameter[:, node[deepest]] @ -shape.nodal_mm2[:, 2]
    slope[_DEPTH, PARAMETER_COUNT : PARAMETER_COUNT + len(around)] = around @ value[deepest]
    slope[_DEPTH] *= depth_mm / max(linear_mm, 1e-9)
    for parameter, estimate in enumerate(("normal_force", "shear_x", "shear_y", "torque"), FORCE):
        slope[ESTIMATES.index(estimate), parameter] = 1.0
    slope[0, CENTRE_X] = slope[1, CENTRE_Y] = 1.0
    return depth_mm, slope, centre_mm


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


def _basis(
    model: BondedPadModel, place_mm: Points2
) -> tuple[Int64[np.ndarray, "k 16"], Float64[np.ndarray, "k 16"]]:
    """Numbers of the nodes and values of the B-splines at places (k, 2) on the pad."""
    first, value = np.empty((len(place_mm), 2), dtype=np.int64), np.empty((len(place_mm), 4, 4))
    fill_basis(place_mm, model.grid, first, value)
    along_x, along_y = (first[:, axis, None] + np.arange(4) for axis in range(2))
    rows, columns = model.grid.count_x + 3, model.grid.count_y + 3
    if model.patch.is_x_slow:
        node = along_x[:, :, None] * columns + along_y[:, None, :]
    else:
        node = along_x[:, :, None] + along_y[:, None, :] * rows
    return node.reshape(-1, 16), value.reshape(-1, 16)


def _unresolved_depth(model: BondedPadModel, parameters: np.ndarray, profile: int) -> float:
    """Depth at the centre of a patch on a half-space that its nodes cannot show.

    To the square of the root of a second moment they add that of `_ELEMENT_ROOT` elements.
    """
    root_mm = float(np.sqrt(abs(parameters[ROOT_XX] * parameters[ROOT_YY])))
    wide_mm = float(np.hypot(root_mm, _ELEMENT_ROOT * max(model.grid.step_x, model.grid.step_y)))
    share = _CENTRE_DEPTH[profile] * (1.0 - model.poisson**2) / np.pi
    return float(share * parameters[FORCE] * (1.0 / root_mm - 1.0 / wide_mm))


def _noise_px(fit: PadFit) -> float:
    """Median standard deviation of the marker images of a frame."""
    return float(1.0 / np.sqrt(median(fit.weight[fit.weight > 0.0])))


def _clusters(model: BondedPadModel, fit: PadFit) -> Clusters:
    """The patches as what `Footprints` computes regions of."""
    count = len(fit.patches)
    spread, covariance = np.empty((count, 2, 2)), np.empty((count, 6, 6))
    scale = misfit_scale(fit)
    order = [SHAPE, 0, 1, 2, 3, 4]
    for number, (xx, yx, yy) in enumerate(fit.patches.parameters[:, ROOT_XX:SHAPE]):
        spread[number] = [[xx * xx, xx * yx], [xx * yx, yx * yx + yy * yy]]
        change = np.eye(6)
        change[3:, 3:] = [[2.0 * xx, 0.0, 0.0], [yx, xx, 0.0], [0.0, 2.0 * yx, 2.0 * yy]]
        at = PARAMETER_COUNT * number + np.array(order)
        covariance[number] = scale * change @ fit.covariance[np.ix_(at, at)] @ change.T
    return Clusters(
        centre_mm=fit.patches.parameters[:, :2],
        force_mm2=np.column_stack([fit.patches.parameters[:, SHEAR_X:TORQUE], -fit.force_mm2]),
        torque_mm3=fit.patches.parameters[:, TORQUE],
        spread_mm2=spread,
        covariance=covariance,
        sheet_covariance=np.zeros((count, 6, 6)),
        label=np.full(model.patch.node_count, -1, dtype=np.int64),
        is_face=np.zeros(count, dtype=np.bool_),
        corner_points_mm=tuple(np.zeros((0, 2)) for _ in range(count)),
        shape_probability=np.full((count, 4), np.nan),
        fitted_mm2=np.full(model.patch.node_count, np.nan),
        is_one_as_before=np.zeros(count, dtype=np.bool_),
    )

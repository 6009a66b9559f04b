"""From force clusters to contacts with their covariances."""

from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float64, Int64
from scipy.spatial import cKDTree

from manytouch.estimation.mechanics.clusters.force_clusters import Clusters
from manytouch.estimation.mechanics.clusters.friction_fits import Friction
from manytouch.estimation.mechanics.clusters.local_deflection import LocalDeflection
from manytouch.estimation.mechanics.inversion.gauss_newton import Fit
from manytouch.estimation.mechanics.inversion.iterate import balance
from manytouch.estimation.mechanics.inversion.sheet_model import InversionModel
from manytouch.estimation.mechanics.inversion.sheet_parameters import ParameterResponse
from manytouch.estimation.mechanics.regions.contact_values import contact_of
from manytouch.estimation.mechanics.regions.footprints import Footprints
from manytouch.geometry.camera import project
from manytouch.geometry.spline.patch import Nodal
from manytouch.mechanics.markers.images import Face
from manytouch.values import ESTIMATES, Contact

_AREA, _DEPTH = ESTIMATES.index("area"), ESTIMATES.index("depth")
_FITTED = [ESTIMATES.index(name) for name in ("normal_force", "x", "y")]
"""Estimates that are those of a fitted patch, in the order of `Clusters.covariance`."""
_FITTED_PAIRS = np.ix_(_FITTED, _FITTED)
_SHEAR = [ESTIMATES.index(name) for name in ("shear_x", "shear_y")]
_TORQUE = ESTIMATES.index("torque")
_LINEAR = [number for number in range(len(ESTIMATES)) if number != _AREA]
"""Estimates whose derivatives by the coefficients of the shape are known: all but the area."""
_ROWS = np.array([2, 2, 0, 1, 2, 1, 0])
"""Components of the forces whose sums over nodes are x and y of the centre, shear along x and y, normal
force, and both parts of the torque."""
_CLAMP_THICKNESSES = 4.0
"""Distance from a clamp, in thicknesses, at which `ModelError.position_clamp` and `force_clamp` apply."""
_FORCES = [ESTIMATES.index(name) for name in ("shear_x", "shear_y", "normal_force", "torque")]
_RINGS = np.array(
    [[0.0, 0.0]]
    + [
        [share * np.cos(angle), share * np.sin(angle)]
        for share, count in ((0.4, 6), (0.8, 10))
        for angle in 2.0 * np.pi * np.arange(count) / count
    ]
)
"""The centre of a disc with radius 1 and points on two circles in it; the deepest of them is searched for."""


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ModelError:
    """Standard deviations of contacts by the error of the model, in addition to the noise of the markers.

    Where two parameters are given for one quantity, their contributions add in quadrature.

    Attributes:
        position_pitch, position_radius: standard deviation of a centre along each axis, in pitches and in
            radii of the contact.
        position_clamp: standard deviation of a centre at four thicknesses from a clamp and across it, in
            thicknesses; e times as much one thickness nearer. The shell has the conditions of a slab at its
            clamp, but not the disturbance within half a thickness of it, and it is too soft under a press
            next to the clamp that is deeper than that.
        depth_share, depth_pitch: standard deviation of the depth, over the depth and in pitches.
        force_share, force_least: standard deviation of the normal force, over that force and over the least
            force of a contact. A thickness that is uneven by 1.5 % changes the stiffness in bending by 4.5 %.
        force_clamp: standard deviation of the normal force over that force at four thicknesses from a clamp;
            e times as much one thickness nearer, like `position_clamp`.
        shear_share, own_shear_share: standard deviation of the shear force along each axis, over the normal
            force and over the shear force.
        friction: standard deviation of the ratio of shear to normal force; smaller ratios hardly move a
            centre, and those on an assumed sheet do not.
        area_share: standard deviation of the area of the region, over that area.
        area_force: standard deviation of the area of a contact with the least force, over that area;
            inversely proportional to the force. Noise spreads faint forces over more nodes.
        assumed_sheet_factor: multiplies all these deviations where the sheet was assumed.
        edge_pitch, edge_depth: standard deviations of the centre along each axis, in pitches, and of the
            depth over the depth, within a pitch of the outermost markers of an assumed sheet; e times less
            each half pitch further inside. Chosen on 23 simulated views.
    """

    position_pitch: float = 0.02
    position_radius: float = 0.05
    position_clamp: float = 0.1
    depth_share: float = 0.028
    depth_pitch: float = 0.002
    force_share: float = 0.045
    force_least: float = 0.25
    force_clamp: float = 0.1
    shear_share: float = 0.03
    own_shear_share: float = 0.15
    friction: float = 0.07
    area_share: float = 0.15
    area_force: float = 0.4
    assumed_sheet_factor: float = 3.0
    edge_pitch: float = 1.0
    edge_depth: float = 0.3

    def variances(
        self,
        model: InversionModel,
        centre_mm: np.ndarray,
        force_mm2: np.ndarray,
        depth_mm: float,
        *,
        patch_area_mm2: float,
        area_mm2: float,
    ) -> np.ndarray:
        """Variances (8,) in the order of `ESTIMATES`, forces over E.

        Args:
            model: of the sheet.
            centre_mm: (2,) of the contact.
            force_mm2: (3,) of the contact over E.
            depth_mm: of the contact.
            patch_area_mm2: area by the second moment of its pressure, which determines its radius.
            area_mm2: area of its region.
        """
        press_mm2, shear_mm2 = -float(force_mm2[2]), float(np.hypot(force_mm2[0], force_mm2[1]))
        radius_mm = np.sqrt(patch_area_mm2 / np.pi)
        place = np.hypot(self.position_pitch * model.pitch_mm, self.position_radius * radius_mm)
        # along x and y: 1 at four thicknesses from a clamp, e times that one thickness nearer, 55 at a clamp
        near_clamp = np.zeros(2)
        if model.patch.boundary == "clamped":
            inside_mm = 0.5 * np.array(model.patch.size_mm) - np.abs(centre_mm - model.patch.centre_mm)
            thicknesses = np.maximum(inside_mm / model.thickness_mm, 0.0)
            near_clamp = np.exp(_CLAMP_THICKNESSES - thicknesses)
        std = [
            *np.hypot(place, self.position_clamp * model.thickness_mm * near_clamp),
            np.hypot(self.depth_share * depth_mm, self.depth_pitch * model.pitch_mm),
            *2 * (np.hypot(self.shear_share * press_mm2, self.own_shear_share * shear_mm2),),
            np.hypot(
                np.hypot(self.force_share, self.force_clamp * near_clamp.max()) * press_mm2,
                self.force_least * model.nodes.least_force_mm2,
            ),
            0.0,  # of the torque: noise and parameters explain its errors
            area_mm2 * np.hypot(self.area_share, self.area_force * model.nodes.least_force_mm2 / press_mm2),
        ]
        variance = np.square(std) * (self.assumed_sheet_factor if model.is_assumed else 1.0) ** 2
        near_edge = model.edge_nearness(centre_mm)
        variance[:2] += (self.edge_pitch * model.pitch_mm * near_edge) ** 2
        variance[_DEPTH] += (np.hypot(model.assumed_depth_std, self.edge_depth * near_edge) * depth_mm) ** 2
        return np.asarray(variance)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ContactEstimator:
    """Computes the contacts of force clusters.

    Attributes:
        error: standard deviations that the model does not explain.
        footprints: regions of the contacts.
        shear_reach: nodes within this distance of a cluster's nodes have a part of its shear, in elements.
    """

    error: ModelError = ModelError()
    footprints: Footprints = field(default_factory=Footprints)
    shear_reach: float = 2.0

    def __call__(
        self,
        model: InversionModel,
        clusters: Clusters,
        fit: Fit,
        local: LocalDeflection | None = None,
        *,
        friction: Friction | None = None,
        response: ParameterResponse | None = None,
    ) -> list[Contact]:
        """Contacts of the fit's clusters, without identity (id -1).

        Force, centre and area are those of a patch of pressure that was fitted to the markers, where there is
        one; the depth is that of the shape.
        """
        if len(clusters) == 0:
            return []
        count = len(clusters)
        near = nearest_cluster(model, clusters, self.shear_reach)
        clusters = with_shear(
            model,
            clusters,
            near,
            fit.shape.force_mm2,
            balance(model, fit.shape.slope, fit.shape.force_mm2),
            friction_std=np.inf if model.is_assumed else self.error.friction,
        )
        patch_area_mm2 = clusters.area_mm2
        radius_mm = np.sqrt(np.maximum(patch_area_mm2, (0.5 * model.pitch_mm) ** 2) / np.pi)
        around_mm = clusters.centre_mm[:, None] + radius_mm[:, None, None] * _RINGS
        face = Face(shell=model.shell, point_mm=around_mm.reshape(-1, 2))
        moved_mm = face.displacement(fit.shape.coefficient_mm).reshape(count, len(_RINGS), 3)
        if local is not None:
            moved_mm[:, :, 2] -= local.depth_mm(clusters, face.point_mm).reshape(count, len(_RINGS))
        deepest = np.argmin(moved_mm[:, :, 2], axis=1)
        here_mm = moved_mm[:, 0] + np.column_stack([clusters.centre_mm, np.zeros(count)])
        centre_px = project(model.camera, here_mm)
        rows = _estimate_rows(model, clusters, fit, near)
        point = np.arange(count) * len(_RINGS) + deepest
        slope = face.derivative_at(point, fit.shape.coefficient_mm)[:, 2]
        rows[np.arange(count)[:, None], _LINEAR.index(_DEPTH), face.node[point]] = -slope
        white = np.zeros((count, len(ESTIMATES), fit.shape.force_mm2.size))
        white[:, _LINEAR] = fit.posterior.whiten(rows.reshape(-1, *fit.shape.force_mm2.shape)).reshape(
            count, len(_LINEAR), -1
        )
        covariance = white @ white.transpose(0, 2, 1)
        if friction is not None:
            covariance += friction.covariance(white)
        if response is not None:
            growth = np.maximum(response.force_ratio(fit, clusters.label, count), 1.0)
            by_parameters = _by_parameters(model, clusters, near, rows, response)
            covariance += np.square(growth)[:, None, None] * by_parameters
        contacts = []
        for number, marker_covariance in enumerate(covariance):
            depth_mm = -float(moved_mm[number, deepest[number], 2])
            # Under a rigid flat face the sheet is equally deep everywhere; under a fitted patch of pressure,
            # it is deeper in the middle. A contact that the markers do not resolve may be either.
            hollow_mm = depth_mm + float(moved_mm[number, :, 2].mean())
            unresolved = min(1.0, model.pitch_mm / float(radius_mm[number]))
            marker_covariance[_DEPTH, _DEPTH] += (0.5 * unresolved * hollow_mm) ** 2
            contacts.append(
                self._contact(
                    model,
                    clusters,
                    number,
                    depth_mm=depth_mm,
                    patch_area_mm2=float(patch_area_mm2[number]),
                    centre_px=centre_px[number],
                    marker_covariance=marker_covariance,
                )
            )
        return contacts

    def _contact(
        self,
        model: InversionModel,
        clusters: Clusters,
        number: int,
        *,
        depth_mm: float,
        patch_area_mm2: float,
        centre_px: np.ndarray,
        marker_covariance: Float64[np.ndarray, "8 8"],
    ) -> Contact:
        """The contact of a cluster.

        `patch_area_mm2` is its `Clusters.area_mm2`. `marker_covariance` is that of its estimates in the order
        of `ESTIMATES`, forces over E, without the error of the model.
        """
        press_mm2 = -float(clusters.force_mm2[number, 2])
        footprint = self.footprints(clusters, number, model.pitch_mm)
        variance = self.error.variances(
            model,
            clusters.centre_mm[number],
            clusters.force_mm2[number],
            depth_mm,
            patch_area_mm2=patch_area_mm2,
            area_mm2=footprint.area_mm2,
        )
        fitted = clusters.covariance[number, :3, :3]
        if np.isfinite(fitted).all():
            scale = np.ones(len(ESTIMATES))
            scale[_FITTED] = np.sqrt(np.diag(fitted) / np.maximum(np.diag(marker_covariance)[_FITTED], 1e-12))
            marker_covariance = marker_covariance * np.outer(scale, scale)
        covariance = marker_covariance + np.diag(variance)
        covariance[_FITTED_PAIRS] += clusters.sheet_covariance[number, :3, :3]
        covariance[_AREA, _AREA] += footprint.area_std_mm2**2
        # an error of E scales all forces alike
        scaled = np.zeros(len(ESTIMATES))
        forces = np.array([*clusters.force_mm2[number, :2], press_mm2, clusters.torque_mm3[number]])
        scaled[_FORCES] = model.young_relative_std * forces
        return contact_of(
            footprint,
            covariance + np.outer(scaled, scaled),
            centre_mm=clusters.centre_mm[number],
            centre_px=centre_px,
            depth_mm=depth_mm,
            force_mm2=clusters.force_mm2[number],
            torque_mm3=float(clusters.torque_mm3[number]),
            young_MPa=model.young_MPa,
        )


def _by_parameters(
    model: InversionModel,
    clusters: Clusters,
    near: Int64[np.ndarray, " nodes"],
    rows: Float64[np.ndarray, "c 7 nodes 3"],
    response: ParameterResponse,
) -> Float64[np.ndarray, "c 8 8"]:
    """Covariance of depth, shear and torque by the parameters of sheet and camera, forces over E.

    That of the other estimates is `Clusters.sheet_covariance`.
    """
    count = len(clusters)
    change = np.zeros((count, len(response.change_mm), len(ESTIMATES)))
    depth_row = rows[:, _LINEAR.index(_DEPTH)].reshape(count, -1)
    change[:, :, _DEPTH] = depth_row @ response.change_mm.reshape(len(response.change_mm), -1).T
    force_mm2 = response.force_change_mm2
    for number in range(count):
        change[number][:, _SHEAR] = force_mm2[:, near == number, :2].sum(axis=1)
        inside = clusters.label == number
        x, y = (model.nodes.place_mm[inside] - clusters.centre_mm[number]).T
        change[number, :, _TORQUE] = force_mm2[:, inside, 1] @ x - force_mm2[:, inside, 0] @ y
    return change.transpose(0, 2, 1) @ change


def _estimate_rows(
    model: InversionModel, clusters: Clusters, fit: Fit, near: Int64[np.ndarray, " nodes"]
) -> Float64[np.ndarray, "c 7 nodes 3"]:
    """Derivatives of the estimates but the area by the coefficients; those of the depth are 0."""
    count, force_z = len(clusters), fit.shape.force_mm2[:, 2]
    number = np.arange(count)[:, None]
    inside, around = clusters.label == number, near == number
    arm = np.where(inside, (model.nodes.place_mm - clusters.centre_mm[:, None]).transpose(2, 0, 1), 0.0)
    pressed = -(inside & (force_z < 0.0)).astype(np.float64)
    share = np.empty((count, len(_ROWS), len(force_z)))
    share[:, 0], share[:, 1] = pressed * arm / clusters.normal_mm2[:, None]
    share[:, 2] = share[:, 3] = around
    share[:, 4], share[:, 5], share[:, 6] = pressed, arm[0], arm[1]
    found = fit.posterior.linearisation.force_rows(
        share.reshape(-1, len(force_z)), np.tile(_ROWS, count)
    ).reshape(*share.shape, 3)
    rows = np.empty_like(found)
    rows[:, :2], rows[:, 2], rows[:, 3:6] = found[:, :2], 0.0, found[:, 2:5]
    np.subtract(found[:, 5], found[:, 6], out=rows[:, 6])
    return rows


def nearest_cluster(
    model: InversionModel, clusters: Clusters, reach_elements: float
) -> Int64[np.ndarray, " nodes"]:
    """(nodes,) cluster of the nearest labelled node within a distance; -1 for none and for fixed nodes."""
    nodes, labelled = model.nodes, np.flatnonzero(clusters.label >= 0)
    near = np.full(len(clusters.label), -1, dtype=np.int64)
    if len(labelled) == 0:
        return near
    place, reach = nodes.place_mm / nodes.element_mm, reach_elements + 1e-3
    own = place[labelled]
    may_be = model.patch.is_free[:, 0] & ~model.is_excluded
    for along, own_along in zip(place.T, own.T, strict=True):
        may_be &= (along >= own_along.min() - reach) & (along <= own_along.max() + reach)
    free = np.flatnonzero(may_be)
    away, which = cKDTree(own).query(place[free], distance_upper_bound=reach)
    is_near = np.isfinite(away)
    near[free[is_near]] = clusters.label[labelled[which[is_near]]]
    return near


def with_shear(
    model: InversionModel,
    clusters: Clusters,
    near: Int64[np.ndarray, " nodes"],
    force_mm2: Nodal,
    balance_mm2: Nodal,
    *,
    friction_std: float,
) -> Clusters:
    """The clusters with the shear of all nodes near them, and with the centres of the pressure.

    Friction S, the force tangential to the deformed sheet in `balance_mm2`, acts on the face of the contact,
    half a thickness t from the middle surface, so that the normal force F on the middle surface is
    (t / 2) S / F ahead of the centre of the pressure. Of S / F the share S^2 / (S^2 + s^2 F^2) counts, with
    its deviation s, and at most 1.
    """
    at = np.flatnonzero(near >= 0)
    force, friction = clusters.force_mm2.copy(), np.empty((len(clusters), 2))
    for axis in range(2):
        force[:, axis] = np.bincount(near[at], force_mm2[at, axis], minlength=len(clusters))
        friction[:, axis] = np.bincount(near[at], balance_mm2[at, axis], minlength=len(clusters))
    friction /= clusters.normal_mm2[:, None]
    squared = np.square(friction).sum(axis=1, keepdims=True)
    counts = squared / (squared + friction_std**2) / np.maximum(1.0, np.sqrt(squared))
    shift_mm = 0.5 * model.thickness_mm * counts * friction
    return replace(clusters, force_mm2=force, centre_mm=clusters.centre_mm - shift_mm)

"""Forces of a rigid plate that covers the whole face of a bonded pad, from its marker images.

The plate sticks to the face, so the face moves as a rigid body: three displacements and three turns, each
with the tractions that the pad of `mechanics` gives it. The view may move between rest and load by a shift, a
growth and a turn with priors, since a sensor that is mounted again shows them too. Young's modulus multiplies
all forces and is fitted to known loads.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from manytouch.estimation.pad.image_error import ImageError
from manytouch.estimation.pad.pad_model import NominalPad
from manytouch.values import Sensor, Sheet
from manytouch.values.sensor_file.default_std import sheet_std

SHIFT_PX, GROWTH, TURN_RAD = 0.3, 5e-3, 5e-3
"""Standard deviations of the motion of the view by mounting again."""
NOISE_PX = 0.02
"""Standard deviation of a mean marker image."""
MODES = 6
ELEMENT = 0.6
"""Length of an element in thicknesses; half of it changes fitted forces by 1 % at most."""
_ROUNDS = 6


@dataclass(frozen=True)
class PlateModel:
    """Marker images (MODES, 2 m) and forces over E (3, MODES) of the plate; motions of the view (4, 2 m).

    The error of the model is a share of the motion around each marker, with weights (m, m) of the markers.
    """

    image: np.ndarray
    force: np.ndarray
    view: np.ndarray
    around: np.ndarray
    share: float


@dataclass(frozen=True)
class PlateForces:
    """Forces over E (n, 3), normal positive in compression, covariances, motions of the view, misfits."""

    force: np.ndarray
    covariance: np.ndarray
    view: np.ndarray
    scale: np.ndarray


def plate_model(sensor: Sensor) -> PlateModel:
    """The plate on the pad of a sensor with its pose."""
    pad, error = NominalPad(element_thickness=ELEMENT)(sensor), ImageError()
    nodes = len(pad.face)
    place = pad.patch.place_mm / (0.5 * max(pad.patch.size_mm))
    rigid = np.zeros((nodes, 3, MODES))
    rigid[:, 0, 0], rigid[:, 1, 1], rigid[:, 2, 2] = 1.0, 1.0, -1.0
    rigid[:, 2, 3], rigid[:, 2, 4] = place[:, 0], place[:, 1]
    rigid[:, 0, 5], rigid[:, 1, 5] = -place[:, 1], place[:, 0]
    flexibility = pad.face.reshape(3 * nodes, 3 * nodes)
    nodal = np.linalg.solve(flexibility, rigid.reshape(3 * nodes, MODES))
    moved_mm = (nodal.T @ pad.marker.reshape(3 * nodes, -1)).reshape(MODES, -1, 3)
    return PlateModel(
        image=np.einsum("mij,kmj->kmi", pad.slope_px, moved_mm).reshape(MODES, -1),
        force=nodal.reshape(nodes, 3, MODES).sum(axis=0) * np.array([1.0, 1.0, -1.0])[:, None],
        view=pad.motion,
        around=error.weights(pad),
        share=error.share,
    )


def plate_forces(model: PlateModel, moved_px: np.ndarray) -> PlateForces:
    """Forces over E for displacements (n, m, 2) of the markers; NaN where a marker was not seen.

    The error of the model is that of pads (`ImageError`): a share of the motion around a marker. With a share
    of its own motion, markers in the middle, which a plate hardly moves, would count too much. It is scaled
    until the misfit of a case is that of its degrees of freedom.
    """
    column = np.vstack([model.image, model.view])
    prior = np.diag(np.r_[np.zeros(MODES), 1.0 / np.square([SHIFT_PX, SHIFT_PX, GROWTH, TURN_RAD])])
    force, covariance, view, scales = [], [], [], []
    for moved in moved_px:
        is_seen = np.repeat(np.isfinite(moved).all(axis=1), 2)
        measured = np.nan_to_num(moved).ravel()
        error = NOISE_PX**2 + np.repeat(model.share**2 * _motion_around(model, moved), 2)
        scale = 1.0
        for _ in range(_ROUNDS):
            weight = is_seen / (scale * error)
            inverse = np.linalg.inv((column * weight) @ column.T + prior)
            found = inverse @ (column @ (weight * measured))
            left = measured - found @ column
            freedom = is_seen.sum() - MODES
            scale = max(1.0, scale * float(weight @ left**2) / freedom)
        force.append(model.force @ found[:MODES])
        covariance.append(model.force @ inverse[:MODES, :MODES] @ model.force.T)
        view.append(found[MODES:])
        scales.append(scale)
    return PlateForces(np.array(force), np.array(covariance), np.array(view), np.array(scales))


def _motion_around(model: PlateModel, moved_px: np.ndarray) -> np.ndarray:
    """(m,) mean squared motion of the seen markers around each, px^2."""
    seen = np.isfinite(moved_px).all(axis=1)
    near = model.around @ seen
    summed = model.around @ (np.nan_to_num(moved_px) ** 2).sum(axis=1)
    return np.divide(summed, near, out=np.zeros_like(near), where=near > 0.0)


def young_MPa(forces: PlateForces, fitted: Sequence[int], normal_N: np.ndarray) -> tuple[float, float]:
    """Modulus, and its relative standard deviation, by the known normal forces of some cases."""
    at = list(fitted)
    over_E = forces.force[at, 2]
    share = np.sqrt(forces.covariance[at, 2, 2]) / over_E
    ratio = normal_N[at] / over_E
    weight = 1.0 / share**2
    value = float(weight @ ratio / weight.sum())
    spread = float(np.std(ratio / value, ddof=1)) if len(at) > 1 else 0.0
    return value, max(float(1.0 / np.sqrt(weight.sum())), spread / np.sqrt(len(at)))


def changed_pads(sensor: Sensor) -> list[Sensor]:
    """The sensor with thickness, Poisson's ratio, marker depth and size each larger by a deviation."""
    sheet = sensor.sheet
    assert sheet is not None
    std = sheet_std(sheet)

    def with_sheet(changed: Sheet) -> Sensor:
        return replace(sensor, sheet=changed)

    poisson = 0.48 if sheet.poisson is None else sheet.poisson
    return [
        with_sheet(replace(sheet, thickness_mm=sheet.thickness_mm + std.thickness_mm)),
        with_sheet(replace(sheet, poisson=min(poisson + (std.poisson or 0.0), 0.495))),
        with_sheet(
            replace(sheet, marker_depth_mm=(sheet.marker_depth_mm or 0.0) + (std.marker_depth_mm or 0.0))
        ),
        with_sheet(replace(sheet, size_mm=sheet.size_mm + 2.0 * std.outline_mm)),
    ]

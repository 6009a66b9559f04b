"""Forces of a rigid plate that lies on the whole face of a bonded pad, from its marker images.

The plate has six motions, sticks to the face and cannot pull it (`plate_contact`). The view may move between
rest and load by a shift, a growth and a turn with priors, since a sensor that is mounted again shows them
too. Young's modulus multiplies all forces and is fitted to known loads.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64
from plate_contact import MODES, PlateContact, plate_contact

from manytouch.estimation.pad.image_error import ImageError
from manytouch.estimation.pad.pad_model import NominalPad
from manytouch.values import Sensor, Sheet
from manytouch.values.arrays import Mask
from manytouch.values.sensor_file.default_std import sheet_std

SHIFT_PX, GROWTH, TURN_RAD = 0.3, 5e-3, 5e-3
"""Standard deviations of the motion of the view by mounting again."""
NOISE_PX = 0.02
"""Standard deviation of a mean marker image."""
ELEMENT = 0.6
"""Length of an element in thicknesses; half of it changes fitted forces by 1 % at most."""
_ROUNDS = 6
"""Fits, between which the error of the model is scaled."""
_STEPS, _LEAST_STEP, _LEAST_GAIN = 30, 0.01, 1e-3
"""Steps of a fit, least share of a step that is right for the same free nodes, and least relative gain."""


@dataclass(frozen=True)
class PlateModel:
    """A plate on a pad with m markers.

    Attributes:
        contact: of the plate.
        view: (4, 2 m) marker images by the motions of the view, px.
        around: (m, m) weights of the markers around each in the error of the model.
        share: standard deviation of the model over the motion around a marker, before it is scaled.
    """

    contact: PlateContact
    view: Float64[np.ndarray, "4 m2"]
    around: Float64[np.ndarray, "m m"]
    share: float


@dataclass(frozen=True)
class PlateForces:
    """Forces over E (n, 3), normal positive in compression, covariances, motions of the view, misfits."""

    force: np.ndarray
    covariance: np.ndarray
    view: np.ndarray
    scale: np.ndarray


@dataclass(frozen=True)
class _State:
    """Motions of plate and view, the free nodes, and what motions do while these stay free.

    Attributes:
        motion: (MODES + 4,) of the plate in mm, and of the view.
        is_free: (n,) nodes that the plate does not press.
        column: (MODES + 4, 2 m) marker images by the motions, px.
        force: (3, MODES) forces over E by the motions of the plate, mm.
    """

    motion: np.ndarray
    is_free: Mask
    column: np.ndarray
    force: np.ndarray


def plate_model(sensor: Sensor) -> PlateModel:
    """The plate on the pad of a sensor with its pose."""
    pad, error = NominalPad(element_thickness=ELEMENT)(sensor), ImageError()
    view = pad.motion[:4]  # shift, growth and turn
    return PlateModel(plate_contact(pad), view, error.weights(pad), error.share)


def plate_forces(model: PlateModel, moved_px: np.ndarray) -> PlateForces:
    """Forces over E for displacements (n, m, 2) of the markers; NaN where a marker was not seen.

    The error of the model is that of pads (`ImageError`): a share of the motion around a marker. With a share
    of its own motion, markers in the middle, which a plate hardly moves, would count too much. It is scaled
    until the misfit of a case is that of its degrees of freedom.
    """
    force, covariance, view, scales = [], [], [], []
    for moved in moved_px:
        state, spread, scale = _fit(model, moved)
        force.append(state.force @ state.motion[:MODES])
        covariance.append(state.force @ spread[:MODES, :MODES] @ state.force.T)
        view.append(state.motion[MODES:])
        scales.append(scale)
    return PlateForces(np.array(force), np.array(covariance), np.array(view), np.array(scales))


def _fit(model: PlateModel, moved_px: np.ndarray) -> tuple[_State, np.ndarray, float]:
    """Motions of a case, their covariance, and the scale of the error of the model."""
    used = np.repeat(np.isfinite(moved_px).all(axis=1), 2)
    measured = np.where(used, moved_px.ravel(), 0.0)
    error = NOISE_PX**2 + np.repeat(model.share**2 * _motion_around(model, moved_px), 2)
    state, scale = _at_rest(model), 1.0
    for _ in range(_ROUNDS):
        weight = used / (scale * error)
        state = _descend(model, state, measured, weight)
        left = measured - state.motion @ state.column
        scale = max(1.0, scale * float(weight @ left**2) / (used.sum() - MODES))
    return state, np.linalg.inv(_curvature(state, weight)), scale


def _motion_around(model: PlateModel, moved_px: np.ndarray) -> np.ndarray:
    """(m,) mean squared motion of the seen markers around each, px^2."""
    seen = np.isfinite(moved_px).all(axis=1)
    near = model.around @ seen
    summed = model.around @ (np.nan_to_num(moved_px) ** 2).sum(axis=1)
    return np.asarray(np.divide(summed, near, out=np.zeros_like(near), where=near > 0.0))


def _descend(model: PlateModel, state: _State, measured: np.ndarray, weight: np.ndarray) -> _State:
    """The motions that explain the images best, from others. Steps take the free nodes as they are."""

    def misfit(tried: _State) -> float:
        left = measured - tried.motion @ tried.column
        return float(weight @ left**2 + _prior() @ tried.motion**2)

    best = misfit(state)
    for _ in range(_STEPS):
        aim = np.linalg.solve(_curvature(state, weight), state.column @ (weight * measured))
        share, before = 1.0, best
        while share > _LEAST_STEP:
            tried = _state(model, state.motion + share * (aim - state.motion), state.is_free)
            if not tried.is_free.all() and misfit(tried) < best:
                state, best = tried, misfit(tried)
                break
            share *= 0.5
        if before - best < _LEAST_GAIN * best:
            break
    return state


def _at_rest(model: PlateModel) -> _State:
    """No motion, of a plate that presses everywhere."""
    motion = np.zeros(MODES + len(model.view))
    return _with_free(model, motion, np.zeros(len(model.contact.place_mm), dtype=np.bool_))


def _state(model: PlateModel, motion: np.ndarray, guess: Mask) -> _State:
    """What follows from motions, with a guess of the free nodes."""
    return _with_free(model, motion, model.contact.free_nodes(motion[:MODES], guess))


def _with_free(model: PlateModel, motion: np.ndarray, is_free: Mask) -> _State:
    """What follows from motions and the free nodes."""
    nodal = model.contact.nodal(is_free)
    column = np.vstack([model.contact.images(nodal), model.view])
    return _State(motion, is_free, column, model.contact.forces(nodal))


def _curvature(state: _State, weight: np.ndarray) -> np.ndarray:
    """Half the second derivative of the misfit by the motions."""
    return np.asarray((state.column * weight) @ state.column.T + np.diag(_prior()))


def _prior() -> np.ndarray:
    """Inverse variances of the motions."""
    return np.asarray(np.r_[np.zeros(MODES), 1.0 / np.square([SHIFT_PX, SHIFT_PX, GROWTH, TURN_RAD])])


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

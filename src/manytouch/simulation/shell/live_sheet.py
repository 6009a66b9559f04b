"""A clamped sheet under rigid bodies, solved while they move: a shear-deformable shell on a grid of 2 mm.

Its fibres stay straight but need not stay normal to the middle surface; membrane and bending are neo-Hooke
in two layers, at any stretch and slope; bodies are pressed into the touched face, which gives way a little
like a bed of springs. See docs/derivations/live-sheet.md, also for what is left out.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from manytouch.simulation.scene.deformation import NO_CONTACT, Deformation, TrueContact
from manytouch.simulation.scene.pressure_region import level_face_mm2, region_area, second_moments
from manytouch.simulation.shell.body_kernels import BodyLoads
from manytouch.simulation.shell.energy import ContactBodies, PosedIndenter, ShellEnergy
from manytouch.simulation.shell.minimisation import EnergyMinimiser
from manytouch.values import Sheet
from manytouch.values.arrays import Points2, Scalars, read_only

SPACING_MM = 2.0


class LiveSheet:
    """The sheet at present; `settle` brings it to equilibrium with the bodies that press."""

    def __init__(self, sheet: Sheet, spacing_mm: float = SPACING_MM) -> None:
        """The sheet at rest.

        Args:
            sheet: its material must be known; a pretension that is not known counts as none.
            spacing_mm: of the grid, about.

        Raises:
            ValueError: the sheet has no Young's modulus or Poisson's ratio.
        """
        self.energy = ShellEnergy(sheet, spacing_mm)
        self._minimiser = EnergyMinimiser(self.energy.preconditioner())
        self.value = np.zeros((5, *self.energy.shape))
        self.stretch = np.ones(self.energy.shape)
        self._posed: tuple[PosedIndenter, ...] = ()
        self.bodies = ContactBodies((), self.energy)
        self._evaluate(self.value)

    def settle(self, bodies: Sequence[PosedIndenter], max_evaluations: int = 14) -> bool:
        """Bring the sheet nearer to equilibrium with these bodies.

        Args:
            bodies: all that press; the contact of one that is at once pressed in by more than half of its
                width may be missed.
            max_evaluations: of the energy, which bounds the work. Where bodies come suddenly, several
                calls may be needed; the thickness of the sheet always follows from call to call.

        Returns:
            Whether it is in equilibrium.
        """
        self._posed, self.bodies = tuple(bodies), ContactBodies(bodies, self.energy)
        self.stretch = self.energy.thickness_ratio()
        found = self._minimiser.minimise(self._evaluate, self.value, max_evaluations)
        self.value = found.value
        return found.has_converged

    def start_from(self, face: Deformation) -> None:
        """Take the shape of a sheet of the same outline, with fibres normal to it and as long as at rest."""
        energy = self.energy
        place_mm = np.stack(np.meshgrid(energy.x_mm, energy.y_mm, indexing="ij"), axis=-1).reshape(-1, 2)
        moved_mm, normal = face.normals(place_mm)
        moved_mm += energy.half_mm * (normal - [0.0, 0.0, 1.0])
        columns = np.column_stack([moved_mm, normal[:, :2] / normal[:, 2:]])
        self.value = np.ascontiguousarray(columns.T).reshape(self.value.shape)
        for line in (self.value[:, 0], self.value[:, -1], self.value[:, :, 0], self.value[:, :, -1]):
            line[:] = 0.0
        self.stretch = np.ones(energy.shape)
        self._minimiser.reset()
        self._evaluate(self.value)

    def deformation(self, pitch_mm: float | None = None) -> Deformation:
        """The present camera-side face, and the contacts of the bodies, in their order.

        Args:
            pitch_mm: of the markers, which defines the regions of contacts; None: they are not computed.
        """
        found, loads = camera_side_face(self.energy, self.value, self.stretch), self.bodies.loads
        contacts = [body_contact(self.energy, loads, number, found) for number in range(len(self._posed))]
        if pitch_mm is not None:
            for number, body in enumerate(self._posed):
                if contacts[number].is_touching:
                    region_mm2 = self._region_mm2(number, body, pitch_mm)
                    contacts[number] = replace(contacts[number], region_mm2=region_mm2)
        return replace(found, contacts=tuple(contacts))

    def _region_mm2(self, number: int, body: PosedIndenter, pitch_mm: float) -> float:
        """`TrueContact.region_mm2` of a body that touches; of a level flat face its footprint."""
        face_mm2 = level_face_mm2(body.indenter, body.rotation_vector)
        if face_mm2 is not None:
            return face_mm2
        return region_area(*pressed_points(self.energy, self.bodies.loads, number), pitch_mm)

    def _evaluate(self, value: np.ndarray) -> tuple[float, np.ndarray]:
        return self.energy(value, self.stretch, self.bodies)


def camera_side_face(energy: ShellEnergy, value: np.ndarray, stretch: np.ndarray) -> Deformation:
    """The camera-side face, without contacts, of a sheet with unknowns (5, a, b) and thickness (a, b)."""
    face_mm = value[:3] - energy.half_mm * energy.fibres(value, stretch)
    face_mm[2] += energy.half_mm
    return Deformation(
        x_mm=energy.x_mm,
        y_mm=energy.y_mm,
        face_mm=read_only(np.ascontiguousarray(np.moveaxis(face_mm, 0, -1), dtype=np.float32)),
        contacts=(),
        status="ok",
    )


def body_contact(energy: ShellEnergy, loads: BodyLoads, number: int, face: Deformation) -> TrueContact:
    """What a body does to the sheet whose camera-side face and loads are given."""
    resultant = loads.resultant[number]
    if resultant[2] == 0.0:
        return NO_CONTACT
    centre_mm = resultant[4:6] / resultant[2]
    place_mm, normal_N = pressed_points(energy, loads, number)
    if not len(place_mm):  # another body has all of its points
        place_mm, normal_N = centre_mm[None], np.ones(1)
    about_mm = centre_mm + face.displacement_mm(centre_mm[None])[0, :2]
    return TrueContact(
        force_N=read_only(resultant[:3].copy()),
        torque_Nmm=float(resultant[3] - about_mm[0] * resultant[1] + about_mm[1] * resultant[0]),
        area_mm2=float(resultant[6]),
        centre_mm=read_only(centre_mm),
        depth_mm=-float(face.displacement_mm(place_mm)[:, 2].min()),
        moment_mm2=second_moments(place_mm, normal_N),
    )


def pressed_points(energy: ShellEnergy, loads: BodyLoads, number: int) -> tuple[Points2, Scalars]:
    """Undeformed places (n, 2) at which a body presses, and its normal forces (n,) there."""
    start_mm = np.array([energy.x_mm[0], energy.y_mm[0]])
    step_mm = energy.spacing_mm * (energy.shape[0] - 1) / loads.body_at.shape[0]
    at = np.argwhere(loads.body_at == number)
    return start_mm + (at + 0.5) * step_mm, loads.normal_N[tuple(at.T)]

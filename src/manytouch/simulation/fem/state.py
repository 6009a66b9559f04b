"""The solved sheet after one step: its shape, and the true force of every contact."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from manytouch.simulation.fem.elements.mesh import HexMesh
from manytouch.simulation.fem.elements.sampling import sample_camera_side


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class ContactForce:
    """What one indenter or patch does to the sheet. NaN where it does not touch.

    Attributes:
        force_N: (3,) on the sheet; a press has z < 0, the normal force is -z. Zero without touch.
        torque_Nmm: about z at the force centroid, with the present lever arms.
        area_mm2: of the touched face in contact, on undeformed coordinates.
        centre_mm: (2,) centroid of the normal force over undeformed coordinates, sum f X / sum f.
        penetration_mm: how far the indenter enters the face at worst.
    """

    force_N: Float64[np.ndarray, "3"]
    torque_Nmm: float
    area_mm2: float
    centre_mm: Float64[np.ndarray, "2"]
    penetration_mm: float

    @property
    def normal_force_N(self) -> float:
        """Positive in compression."""
        return -float(self.force_N[2])


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SheetState:
    """The sheet in equilibrium after one step, and all that the next step needs.

    Attributes:
        mesh: the mesh of the displacements.
        displacement_mm: (n, 3) of the nodes from the mounted, unloaded sheet.
        support_N: (3,) what the frame does to the sheet.
        contacts: first one for each touch, then one for each patch of the loading.
        status: "ok" or "not_converged" (then the state is the last equilibrium on the way).
        reached: share of the step that was solved, 1 when "ok".
        newton_steps: linear systems solved for this step.
        residual_N: norm of the forces out of balance.
        dead_N: (n, 3) nodal forces of patches and weight.
        position_mm, rotation_vector: (t, 3) poses of the indenters.
        pressure_MPa: (t, f, q) at the points of the touched face, per undeformed area.
        shear_MPa: (t, f, q, 3) friction, likewise.
    """

    mesh: HexMesh
    displacement_mm: Float64[np.ndarray, "nodes 3"]
    support_N: Float64[np.ndarray, "3"]
    contacts: tuple[ContactForce, ...]
    status: str
    reached: float
    newton_steps: int
    residual_N: float
    dead_N: Float64[np.ndarray, "nodes 3"]
    position_mm: Float64[np.ndarray, "touches 3"]
    rotation_vector: Float64[np.ndarray, "touches 3"]
    pressure_MPa: Float64[np.ndarray, "t f q"]
    shear_MPa: Float64[np.ndarray, "t f q 3"]

    def camera_side(
        self, place_mm: Float64[np.ndarray, "m 2"]
    ) -> tuple[Float64[np.ndarray, "m 3"], Float64[np.ndarray, "m 3 3"]]:
        """Displacement (m, 3) and F (m, 3, 3) of the camera-side face; see `sample_camera_side`."""
        return sample_camera_side(self.mesh, self.displacement_mm, place_mm)

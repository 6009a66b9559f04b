"""A shape of the sheet with the forces that keep it there, which the inversion fits to the markers."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64

from manytouch.estimation.mechanics.inversion.sheet_model import InversionModel
from manytouch.geometry.spline.patch import Nodal
from manytouch.values.arrays import Points2, read_only


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class BodyForce:
    """The force per volume that weight and inertia exert on a sheet, less that at rest.

    Attributes:
        acceleration_g: (3,) in multiples of g, sheet frame.
        covariance_g2: (3, 3) of its error, with that of what it does to the model of the sheet.
        force_mm2: (n, 3) nodal forces over E.
    """

    acceleration_g: Float64[np.ndarray, "3"]
    covariance_g2: Float64[np.ndarray, "3 3"]
    force_mm2: Nodal

    @property
    def deviations_g(self) -> Float64[np.ndarray, "3 3"]:
        """Independent errors of the acceleration, of one standard deviation, one in each row."""
        return np.asarray(np.linalg.cholesky(self.covariance_g2).T)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SheetShape:
    """A shape of the sheet and the forces that keep it there.

    Attributes:
        coefficient_mm: (n, 3) of the displacement of the middle surface, sheet frame.
        force_mm2: (n, 3) nodal forces over E of objects on the sheet; a press has z < 0.
        displacement_px: (m, 2) of the marker images.
        slope: (n, 2) of the deflection along x and y at the nodes.
        body_force: on the sheet; None if it is not estimated.
    """

    coefficient_mm: Nodal
    force_mm2: Nodal
    displacement_px: Points2
    slope: Float64[np.ndarray, "nodes 2"]
    body_force: BodyForce | None

    @staticmethod
    def at_rest(model: InversionModel, body_force: BodyForce | None = None) -> "SheetShape":
        """The flat shape."""
        return SheetShape.at(model, np.zeros((model.patch.node_count, 3)), body_force)

    @staticmethod
    def at(model: InversionModel, coefficient_mm: Nodal, body_force: BodyForce | None = None) -> "SheetShape":
        """The shape with coefficients (n, 3), which become read-only."""
        force_mm2 = model.shell.forces(coefficient_mm)
        if body_force is not None:
            force_mm2 -= body_force.force_mm2
        return SheetShape(
            coefficient_mm=read_only(coefficient_mm),
            force_mm2=read_only(force_mm2),
            body_force=body_force,
            displacement_px=read_only(model.dots.displacement_px(coefficient_mm)),
            slope=read_only(model.patch.slopes(coefficient_mm[:, 2])),
        )

    def changed(self, model: InversionModel, change_mm: Nodal) -> "SheetShape":
        """The shape after a change of the coefficients that hardly moves the marker images, which stay."""
        before_mm2, after_mm2 = self.internal_mm2, model.shell.forces(self.coefficient_mm + change_mm)
        return self.moved(model, change_mm, after_mm2 - before_mm2)

    @property
    def internal_mm2(self) -> Nodal:
        """(n, 3) nodal forces over E of the deformed sheet, those by its body force included."""
        return self.force_mm2 if self.body_force is None else self.force_mm2 + self.body_force.force_mm2

    def moved(self, model: InversionModel, change_mm: Nodal, force_change_mm2: Nodal) -> "SheetShape":
        """The shape after changes (nodes, 3) of coefficients and forces; the marker images stay."""
        coefficient_mm = self.coefficient_mm + change_mm
        return replace(
            self,
            coefficient_mm=read_only(coefficient_mm),
            force_mm2=read_only(self.force_mm2 + force_change_mm2),
            slope=read_only(model.patch.slopes(coefficient_mm[:, 2])),
        )

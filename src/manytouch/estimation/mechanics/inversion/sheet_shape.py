"""A shape of the sheet with the forces that keep it there, which the inversion fits to the markers."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64

from manytouch.estimation.mechanics.inversion.sheet_model import InversionModel
from manytouch.geometry.spline.patch import Nodal
from manytouch.values.arrays import Points2, read_only


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class SheetShape:
    """A shape of the sheet and the forces that keep it there.

    Attributes:
        coefficient_mm: (n, 3) of the displacement of the middle surface, sheet frame.
        force_mm2: (n, 3) nodal forces over E of objects on the sheet; a press has z < 0.
        displacement_px: (m, 2) of the marker images.
        slope: (n, 2) of the deflection along x and y at the nodes.
    """

    coefficient_mm: Nodal
    force_mm2: Nodal
    displacement_px: Points2
    slope: Float64[np.ndarray, "nodes 2"]

    @staticmethod
    def at_rest(model: InversionModel) -> "SheetShape":
        """The shape of a sheet that nothing touches."""
        return SheetShape.at(model, np.zeros((model.patch.node_count, 3)))

    @staticmethod
    def at(model: InversionModel, coefficient_mm: Nodal) -> "SheetShape":
        """The shape with coefficients (n, 3), which become read-only."""
        return SheetShape(
            coefficient_mm=read_only(coefficient_mm),
            force_mm2=read_only(model.shell.forces(coefficient_mm)),
            displacement_px=read_only(model.dots.displacement_px(coefficient_mm)),
            slope=read_only(model.patch.slopes(coefficient_mm[:, 2])),
        )

    def changed(self, model: InversionModel, change_mm: Nodal) -> "SheetShape":
        """The shape after a change of the coefficients that hardly moves the marker images, which stay."""
        forces_mm2 = model.shell.forces(self.coefficient_mm + change_mm)
        return self.moved(model, change_mm, forces_mm2 - self.force_mm2)

    def moved(self, model: InversionModel, change_mm: Nodal, force_change_mm2: Nodal) -> "SheetShape":
        """The shape after changes (nodes, 3) of coefficients and forces; the marker images stay."""
        coefficient_mm = self.coefficient_mm + change_mm
        return replace(
            self,
            coefficient_mm=read_only(coefficient_mm),
            force_mm2=read_only(self.force_mm2 + force_change_mm2),
            slope=read_only(model.patch.slopes(coefficient_mm[:, 2])),
        )

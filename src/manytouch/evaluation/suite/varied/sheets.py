"""The sheets of the varied cases."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True, kw_only=True)
class VariedSheet:
    """A clamped sheet with dots.

    Attributes:
        size_mm, thickness_mm, young_MPa, poisson: of the sheet.
        strain: equal strain along x and y to which the sheet is stretched before it is clamped; 0: no
            pretension.
        pitch_mm: of its dots.
    """

    size_mm: tuple[float, float]
    thickness_mm: float
    young_MPa: float
    poisson: float
    strain: float
    pitch_mm: float

    @property
    def pretension_N_per_mm(self) -> float:
        """Membrane force by `strain` per length of the clamp, by Hooke's law for small strains."""
        return round(self.strain * self.young_MPa * self.thickness_mm / (1.0 - self.poisson), 4)

    @property
    def gap_mm(self) -> float:
        """Least distance between two bodies, and of a body from the clamp."""
        return max(1.5 * self.pitch_mm, 2.0 * self.thickness_mm, 5.0)

    def force_N(self, depth_mm: float, radius_mm: float) -> float:
        """Approximate force of a press in the middle of a round clamped sheet, as wide as the shorter side.

        It is that of a plate of radius a that is loaded at its centre, with the stretching of large
        deflections w: 16 pi D w / a^2 (1 + 0.44 (w / t)^2) (S. Timoshenko and S. Woinowsky-Krieger, Theory of
        Plates and Shells, 1959, chapter 13), plus that of a membrane under the pretension N that is pressed
        by a disc of radius r: 2 pi N w / log(a / r).

        Args:
            depth_mm: w.
            radius_mm: r; a / r is taken as at least 1.6.
        """
        a_mm, t_mm = 0.5 * min(self.size_mm), self.thickness_mm
        rigidity = self.young_MPa * t_mm**3 / 12.0 / (1.0 - self.poisson**2)
        bending = 16.0 * np.pi * rigidity / a_mm**2 * (1.0 + 0.44 * (depth_mm / t_mm) ** 2)
        tension = 2.0 * np.pi * self.pretension_N_per_mm / np.log(max(a_mm / radius_mm, 1.6))
        return float((bending + tension) * depth_mm)


SHEETS: dict[str, VariedSheet] = {
    "slack": VariedSheet(
        size_mm=(120.0, 80.0), thickness_mm=3.0, young_MPa=3.1, poisson=0.45, strain=0.0, pitch_mm=4.0
    ),
    "tight": VariedSheet(
        size_mm=(120.0, 80.0), thickness_mm=3.0, young_MPa=1.0, poisson=0.47, strain=0.02, pitch_mm=4.0
    ),
    "small": VariedSheet(
        size_mm=(60.0, 60.0), thickness_mm=1.5, young_MPa=0.6, poisson=0.49, strain=0.02, pitch_mm=2.0
    ),
    "foam": VariedSheet(
        size_mm=(90.0, 70.0), thickness_mm=2.0, young_MPa=2.0, poisson=0.3, strain=0.003, pitch_mm=3.0
    ),
    "4-mm": VariedSheet(
        size_mm=(160.0, 100.0), thickness_mm=4.0, young_MPa=2.0, poisson=0.48, strain=0.005, pitch_mm=5.0
    ),
    "5-mm": VariedSheet(
        size_mm=(100.0, 100.0), thickness_mm=5.0, young_MPa=1.0, poisson=0.4, strain=0.0, pitch_mm=5.0
    ),
    "6-mm": VariedSheet(
        size_mm=(120.0, 90.0), thickness_mm=6.0, young_MPa=0.5, poisson=0.45, strain=0.01, pitch_mm=6.0
    ),
    "large": VariedSheet(
        size_mm=(300.0, 200.0), thickness_mm=3.0, young_MPa=3.1, poisson=0.47, strain=0.03, pitch_mm=8.0
    ),
    "wide": VariedSheet(
        size_mm=(200.0, 150.0), thickness_mm=2.0, young_MPa=5.0, poisson=0.35, strain=0.01, pitch_mm=6.0
    ),
    "gel": VariedSheet(
        size_mm=(140.0, 90.0), thickness_mm=4.5, young_MPa=0.3, poisson=0.49, strain=0.015, pitch_mm=4.0
    ),
}

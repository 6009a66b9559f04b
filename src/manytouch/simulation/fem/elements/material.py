"""Nearly incompressible neo-Hooke and Yeoh, and what a pretension in N/mm means for them.

W = mu/2 (J^(-2/3) I1 - 3) + k/2 (J - 1)^2 per undeformed volume, I1 = tr F^T F, J = det F
(J. Bonet and R. D. Wood, Nonlinear Continuum Mechanics for Finite Element Analysis, 2008, ch. 6).
For small strains it is Hooke's law with E and nu. Yeoh's law (O. H. Yeoh 1993, doi:10.5254/1.3538343) has
mu/2 (x + a x^2 + b x^3), x = J^(-2/3) I1 - 3, instead of mu/2 x.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from scipy.optimize import root

from manytouch.values.arrays import read_only


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class NeoHooke:
    """A rubber.

    Attributes:
        young_MPa, poisson: for small strains; 0 <= poisson < 0.5.
        density_kg_m3: for its weight.
    """

    young_MPa: float
    poisson: float
    density_kg_m3: float = 960.0

    def __post_init__(self) -> None:
        if not self.young_MPa > 0.0:
            raise ValueError(f"young_MPa is {self.young_MPa}, expected a positive number")
        if not 0.0 <= self.poisson < 0.5:
            raise ValueError(
                f"poisson is {self.poisson}, expected at least 0 and below 0.5 (0.49 does for rubber)"
            )

    @property
    def shear_MPa(self) -> float:
        """mu = E / (2 (1 + nu))."""
        return self.young_MPa / (2.0 * (1.0 + self.poisson))

    @property
    def bulk_MPa(self) -> float:
        """k = E / (3 (1 - 2 nu))."""
        return self.young_MPa / (3.0 * (1.0 - 2.0 * self.poisson))

    @property
    def stiffening(self) -> tuple[float, float]:
        """The factors a and b of Yeoh's law, 0 for neo-Hooke."""
        return 0.0, 0.0

    def cauchy_MPa(self, stretch: Float64[np.ndarray, "3"]) -> Float64[np.ndarray, "3"]:
        """(3,) true principal stresses under principal stretches."""
        square = stretch**2
        volume = float(np.prod(stretch))
        deviator = square - square.sum() / 3.0
        excess, (second, third) = volume ** (-2.0 / 3.0) * square.sum() - 3.0, self.stiffening
        slope = 1.0 + excess * (2.0 * second + 3.0 * third * excess)
        isochoric = self.shear_MPa * volume ** (-5.0 / 3.0) * slope * deviator
        return np.asarray(isochoric + self.bulk_MPa * (volume - 1.0))

    def prestretch(self, tension_N_per_mm: float, thickness_mm: float) -> Float64[np.ndarray, "3"]:
        """(3,) stretches that the sheet has before it is clamped, equal in x and y.

        The mounted sheet (its size, its thickness, its markers) is the reference of every displacement.
        It was stretched by `stretch[0]` in all directions of its plane with free faces (sigma_zz = 0),
        so that a cut along a line of the mounted sheet pulls with sigma_xx times the mounted thickness.

        Raises:
            ValueError: no stretch gives this tension.
        """

        def imbalance(stretch: np.ndarray) -> np.ndarray:
            stress = self.cauchy_MPa(np.array([stretch[0], stretch[0], stretch[1]]))
            return np.array([stress[0] - tension_N_per_mm / thickness_mm, stress[2]]) / self.young_MPa

        strain = (1.0 - self.poisson) * tension_N_per_mm / (thickness_mm * self.young_MPa)
        guess = [1.0 + strain, 1.0 / (1.0 + strain) ** (2.0 * self.poisson / (1.0 - self.poisson))]
        found = root(imbalance, guess, tol=1e-13)
        if np.abs(found.fun).max() > 1e-10 or found.x.min() <= 0.0:
            raise ValueError(
                f"{tension_N_per_mm} N/mm is too much for a {thickness_mm} mm sheet of {self.young_MPa} MPa"
            )
        return read_only(np.array([found.x[0], found.x[0], found.x[1]]))


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Yeoh(NeoHooke):
    """A rubber whose shear modulus changes with strain.

    Attributes:
        second, third: the factors a and b of its energy; natural rubber has about -0.05 and 0.005, silicones
            stiffen sooner.
    """

    second: float
    third: float

    @property
    def stiffening(self) -> tuple[float, float]:
        """The factors a and b of its energy."""
        return self.second, self.third

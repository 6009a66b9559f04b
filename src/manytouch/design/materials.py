"""Materials of sheets, and their stiffness from the Shore A hardness."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Material:
    """A soft material.

    Its modulus follows from `shore_A` and cannot be stated. It is nominal, within a factor of about 1.3;
    calibration measures it.

    Attributes:
        name: generic name, which `manytouch design --material` takes.
        shore_A: hardness.
        strength_MPa: stress at break.
        density_kg_m3: mass density.
        process: `cast` or `printed`.
    """

    name: str
    shore_A: float
    strength_MPa: float
    density_kg_m3: float
    process: str

    @property
    def young_MPa(self) -> float:
        """Young's modulus; see `young_of_hardness_MPa`."""
        return young_of_hardness_MPa(self.shore_A)


POISSON = 0.45  # the value of the paper; rubbers have 0.45 to 0.5

MATERIALS = (
    Material(
        name="silicone, Shore A 20", shore_A=20.0, strength_MPa=3.0, density_kg_m3=1080.0, process="cast"
    ),
    Material(
        name="silicone, Shore A 40", shore_A=40.0, strength_MPa=6.0, density_kg_m3=1120.0, process="cast"
    ),
    Material(
        name="TPU, Shore A 60", shore_A=60.0, strength_MPa=20.0, density_kg_m3=1100.0, process="printed"
    ),
    Material(
        name="TPU, Shore A 70", shore_A=70.0, strength_MPa=25.0, density_kg_m3=1120.0, process="printed"
    ),
    Material(
        name="TPU, Shore A 85", shore_A=85.0, strength_MPa=35.0, density_kg_m3=1150.0, process="printed"
    ),
    Material(
        name="TPU, Shore A 95", shore_A=95.0, strength_MPa=40.0, density_kg_m3=1210.0, process="printed"
    ),
)


def young_of_hardness_MPa(shore_A: float) -> float:
    """Young's modulus of a rubber from its Shore A hardness (A. N. Gent, doi:10.5254/1.3542351).

    E = 0.0981 (56 + 7.62336 S) / (0.137505 (254 - 2.54 S)); accurate to about 20 % for S from 20 to 80.
    """
    return 0.0981 * (56 + 7.62336 * shore_A) / (0.137505 * (254 - 2.54 * shore_A))

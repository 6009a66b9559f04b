"""Sheets whose properties have no standard deviations, so that those of the estimates are by noise only."""

EXACT = {
    "outline_std_mm": 0.0,
    "thickness_std_mm": 0.0,
    "young_std_MPa": 0.0,
    "poisson_std": 0.0,
    "pretension_std_N_per_mm": 0.0,
    "bending_factor_std": 0.0,
}

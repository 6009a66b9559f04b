"""What `calibrate rest` and `calibrate sheet` find of the sheets of the accuracy suite (ADR 111).

    .venv/bin/python benchmarks/calibrated_sheets.py [--only SHEET ...]

Each sheet is given with the errors of the group `drawn` and pressed as in the group `calibrated`: a line for
each with the numbers found over the true ones, and their errors in standard deviations. Three minutes on a
quiet machine.
"""

import argparse

from manytouch.evaluation.suite.calibrated.sheet_sensor import calibrated_sensor
from manytouch.evaluation.suite.varied.sheets import SHEETS


def line(name: str) -> str:
    true, found = SHEETS[name], calibrated_sensor(name).sheet
    assert found is not None
    assert found.young_MPa is not None
    assert found.young_std_MPa is not None
    assert found.thickness_std_mm is not None
    assert found.pretension_N_per_mm is not None
    assert found.pretension_std_N_per_mm is not None
    tension, true_tension = found.pretension_N_per_mm, true.pretension_N_per_mm
    stds = (
        (found.young_MPa - true.young_MPa) / found.young_std_MPa,
        (found.thickness_mm - true.thickness_mm) / found.thickness_std_mm,
        (tension - true_tension) / found.pretension_std_N_per_mm,
    )
    return (
        f"{name:6} E {found.young_MPa / true.young_MPa:.3f}, t {found.thickness_mm / true.thickness_mm:.3f}, "
        f"bending factor {found.bending_factor:.3f}, pretension {tension:.4f} of {true_tension:.4f} N/mm, "
        f"outline {found.size_mm[0] - true.size_mm[0]:+.2f} x {found.size_mm[1] - true.size_mm[1]:+.2f} mm; "
        f"errors of E, t, pretension {', '.join(f'{each:+.1f}' for each in stds)} std"
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", nargs="+", choices=list(SHEETS), default=list(SHEETS), help="sheets")
    for name in parser.parse_args().only:
        print(line(name), flush=True)


if __name__ == "__main__":
    main()

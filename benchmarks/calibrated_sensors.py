"""What `calibrate rest` and `calibrate sheet` find of the sheets and pads of the suite (ADR 111, 114).

    .venv/bin/python benchmarks/calibrated_sensors.py [--only NAME ...]

Each sheet is given with the errors of the group `drawn` and pressed as in the group `calibrated`: a line for
each with the numbers found over the true ones, and their errors in standard deviations. Pads have the errors
and the presses of `pads_calibrated`: E, thickness and depth of the markers are found. Seven minutes on a
quiet machine.
"""

import argparse

from manytouch.evaluation.suite.calibrated.pad_sensor import calibrated_pad, calibration_presses, drawn_pad
from manytouch.evaluation.suite.calibrated.sheet_sensor import calibrated_sensor
from manytouch.evaluation.suite.pads.cases import PADS
from manytouch.evaluation.suite.varied.sheets import SHEETS

NAMES = [*SHEETS, *PADS]


def line(name: str) -> str:
    """What was found of a sheet or pad."""
    return pad_line(name) if name in PADS else sheet_line(name)


def pad_line(name: str) -> str:
    case = calibration_presses(name)[0]
    given, found = drawn_pad(case).sheet, calibrated_pad(name).sheet
    assert given is not None
    assert given.marker_depth_mm is not None
    assert found is not None
    assert found.young_MPa is not None
    assert found.young_std_MPa is not None
    assert found.thickness_std_mm is not None
    assert found.marker_depth_mm is not None
    assert found.marker_depth_std_mm is not None
    stds = (
        (found.young_MPa - case.young_MPa) / found.young_std_MPa,
        (found.thickness_mm - case.thickness_mm) / found.thickness_std_mm,
        (found.marker_depth_mm - case.marker_depth_mm) / found.marker_depth_std_mm,
    )
    return (
        f"{name:6} E {found.young_MPa / case.young_MPa:.3f}, "
        f"t {given.thickness_mm / case.thickness_mm:.3f} -> {found.thickness_mm / case.thickness_mm:.3f}, "
        f"depth of the markers {given.marker_depth_mm - case.marker_depth_mm:+.3f} -> "
        f"{found.marker_depth_mm - case.marker_depth_mm:+.3f} mm; "
        f"errors of E, t, depth {', '.join(f'{each:+.1f}' for each in stds)} std"
    )


def sheet_line(name: str) -> str:
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
    parser.add_argument("--only", nargs="+", choices=NAMES, default=NAMES, help="sheets and pads")
    for name in parser.parse_args().only:
        print(line(name), flush=True)


if __name__ == "__main__":
    main()

"""Lines of text that describe a calibration of the sheet, and the calibrated sensor with its provenance."""

import math
from collections.abc import Iterator
from dataclasses import replace

from manytouch.calibration.sheet.calibrate import SheetCalibration
from manytouch.values import Sensor


def describe(calibration: SheetCalibration) -> Iterator[str]:
    """Lines about parameters with standard deviations, residuals, undetermined parameters and warnings."""
    sheet, std = calibration.sheet, calibration.std
    if "thickness_std_mm" in std:
        yield f"thickness {sheet.thickness_mm:.3f} ± {std['thickness_std_mm']:.3f} mm"
    if "marker_depth_std_mm" in std:
        yield f"depth of the markers {sheet.marker_depth_mm:.3f} ± {std['marker_depth_std_mm']:.3f} mm"
    if "outline_std_mm" in std:
        width_mm, height_mm = sheet.size_mm.tolist()
        yield f"outline {width_mm:.2f} x {height_mm:.2f} mm, each side ± {std['outline_std_mm']:.2f} mm"
    if "bending_factor_std" in std:
        yield f"bending factor {sheet.bending_factor:.3f} ± {std['bending_factor_std']:.3f}"
    if sheet.pretension_N_per_mm is not None:
        yield f"pretension {sheet.pretension_N_per_mm:.4f} ± {std['pretension_std_N_per_mm']:.4f} N/mm"
    if "young_std_MPa" in std:
        yield f"Young's modulus {sheet.young_MPa:.3f} ± {std['young_std_MPa']:.3f} MPa"
    yield f"largest RMS residual of a press {calibration.residual_px.max():.3f} px"
    errors = [100 * value for value in calibration.leave_one_out_error.tolist() if math.isfinite(value)]
    if errors:
        rms = math.sqrt(sum(value**2 for value in errors) / len(errors))
        yield f"leave-one-out force error {rms:.1f} % (RMS), {max(map(abs, errors)):.1f} % (maximum)"
    yield from calibration.undetermined
    yield from (f"warning: {sentence}" for sentence in calibration.warnings)


def with_provenance(sensor: Sensor, calibration: SheetCalibration, table_name: str) -> Sensor:
    """The sensor with the calibrated sheet; its provenance names the table and the standard deviations."""
    provenance = {
        **sensor.provenance,
        "sheet": f"calibrated from {len(calibration.residual_px)} presses in {table_name}",
        **{f"sheet_{name}": value for name, value in calibration.std.items()},
    }
    return replace(sensor, sheet=calibration.sheet, provenance=provenance)

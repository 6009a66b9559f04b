"""A calibration of the sheet as lines of text, and its sensor with provenance."""

import math
from collections.abc import Iterator
from dataclasses import replace

from manytouch.calibration.sheet.calibrate import SheetCalibration
from manytouch.values import Sensor


def describe(calibration: SheetCalibration) -> Iterator[str]:
    """Lines about parameters with standard deviations, residuals, undetermined parameters and warnings."""
    sheet, std = calibration.sheet, calibration.std
    if "thickness_mm" in std:
        yield f"thickness {sheet.thickness_mm:.3f} ± {std['thickness_mm']:.3f} mm"
    if "bending_factor" in std:
        yield f"bending factor {sheet.bending_factor:.3f} ± {std['bending_factor']:.3f}"
    if sheet.pretension_N_per_mm is not None:
        yield f"pretension {sheet.pretension_N_per_mm:.4f} ± {std['pretension_N_per_mm']:.4f} N/mm"
    if "young_MPa" in std:
        yield f"stiffness E {sheet.young_MPa:.3f} ± {std['young_MPa']:.3f} MPa"
    yield f"residual of a press {calibration.residual_px.max():.3f} px (RMS) at most"
    errors = [100 * value for value in calibration.left_out.tolist() if math.isfinite(value)]
    if errors:
        yield (
            f"leave-one-out force error {sum(errors) / len(errors):+.1f} % (mean), "
            f"{max(map(abs, errors)):.1f} % (maximum)"
        )
    yield from calibration.undetermined
    yield from (f"warning: {sentence}" for sentence in calibration.warnings)


def with_provenance(sensor: Sensor, calibration: SheetCalibration, table_name: str) -> Sensor:
    """The sensor with the calibrated sheet; its provenance names the table and the standard deviations."""
    provenance = {
        **sensor.provenance,
        "sheet": f"calibrated from {len(calibration.residual_px)} presses in {table_name}",
        **{f"sheet_std_{name}": value for name, value in calibration.std.items()},
    }
    return replace(sensor, sheet=calibration.sheet, provenance=provenance)

"""Whether presses determine Young's modulus, and warnings about a modulus that is hardly credible."""

from collections.abc import Sequence

import numpy as np

from manytouch.calibration.sheet.fit import KnownPress
from manytouch.errors import SensorError
from manytouch.values import Sheet
from manytouch.values.arrays import Scalars
from manytouch.values.sensor_file.default_std import sheet_std

MOST_STD_SHARE = 0.5
"""Largest standard deviation of a modulus over its value. Beyond, no force in N would differ from 0 by two
deviations, so that the calibrated sensor would have no forces."""
LARGE_ERROR = 0.5
"""RMS of the leave-one-out force errors from which on there is a warning."""
MOST_DIFFERENCE_STDS = 3.0
"""Difference between the logarithms of the modulus and that of the sensor file, over the deviation of their
difference, from which on there is a warning."""


def require_determined(
    presses: Sequence[KnownPress], young_MPa: float, std_MPa: float, leave_one_out_error: Scalars
) -> None:
    """Check that the forces of presses determine a modulus, or at least each other.

    On a clamped sheet the modulus may be uncertain together with pretension and bending while forces are not,
    so that it is refused only if the forces predicted from each other are as uncertain.

    Args:
        presses: from which the modulus was found.
        young_MPa, std_MPa: modulus and standard deviation.
        leave_one_out_error: (k,) of the forces of the presses; NaN where not known.

    Raises:
        SensorError: they do not.
    """
    known = np.flatnonzero(np.isfinite(leave_one_out_error))
    if len(known) == 0 or std_MPa <= MOST_STD_SHARE * young_MPa:
        return
    log_error = np.abs(np.log1p(leave_one_out_error[known]))
    if np.sqrt(np.mean(log_error**2)) <= MOST_STD_SHARE:
        return
    worst = int(known[np.argmax(log_error)])
    raise SensorError(
        f"the presses do not determine Young's modulus: it is {young_MPa:.2g} ± {std_MPa:.2g} MPa, and "
        f"forces predicted from the other presses are {_rms_percent(leave_one_out_error):.0f} % (RMS) off, "
        f"most that of {presses[worst].name} ({100 * leave_one_out_error[worst]:+.0f} %). With a deviation "
        "of more than half of the modulus no force would differ from 0. Check place, time and force (in N) "
        "of each press, let only a foot or ball touch that is narrower than a pad is thick, begin the "
        "recording untouched, and repeat with more presses"
    )


def modulus_warnings(
    sheet: Sheet, young_MPa: float | None, std_MPa: float | None, leave_one_out_error: Scalars
) -> list[str]:
    """Sentences on forces that contradict each other, or the modulus in the sensor file.

    Args:
        sheet: of the sensor file.
        young_MPa, std_MPa: what presses give; None if no force was measured.
        leave_one_out_error: (k,) of the forces of the presses; NaN where not known.
    """
    sentences = []
    if np.isfinite(leave_one_out_error).any():
        rms = _rms_percent(leave_one_out_error)
        if rms > 100.0 * LARGE_ERROR:
            sentences.append(
                f"forces predicted from the other presses are {rms:.0f} % (RMS) off: check place, time and "
                "force of each press, and that only the foot or ball touched"
            )
    stated_MPa, stated_std_MPa = sheet.young_MPa, sheet_std(sheet).young_MPa
    if young_MPa is None or std_MPa is None or stated_MPa is None or stated_std_MPa is None:
        return sentences
    std = float(np.hypot(std_MPa / young_MPa, stated_std_MPa / stated_MPa))
    if abs(np.log(young_MPa / stated_MPa)) > MOST_DIFFERENCE_STDS * std:
        sentences.append(
            f"Young's modulus of {young_MPa:.3g} ± {std_MPa:.2g} MPa differs by more than "
            f"{MOST_DIFFERENCE_STDS:g} deviations from the {stated_MPa:.3g} ± {stated_std_MPa:.2g} MPa of "
            "the sensor file: check that forces are in N, that only the foot or ball touched, and the "
            "thickness of the sheet"
        )
    return sentences


def _rms_percent(error: Scalars) -> float:
    """RMS of the known relative errors (k,)."""
    known = error[np.isfinite(error)]
    return 100.0 * float(np.sqrt(np.mean(known**2)))

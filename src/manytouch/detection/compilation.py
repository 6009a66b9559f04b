"""How the small kernels that run once for each dot are compiled."""

from typing import Any

from numba.core.options import DefaultOptions

# The sums may run in lanes; NaN and infinity stay what they are.
FAST = {"reassoc", "contract", "nsz", "arcp"}

# Counting references to arrays at each call costs as much as the work itself, and these kernels only read
# and write arrays that their caller holds. The switch is numba's own: without it they are right, but slower.
LEAF: dict[str, Any] = {"cache": True, "error_model": "numpy", "forceinline": True}
if hasattr(DefaultOptions, "_nrt"):
    LEAF["_nrt"] = False

"""Cases of bonded pads: what presses, their sensor files and their recordings.

Solved presses ship with the package; `benchmarks/ship_pads.py` and `ship_calculix_pads.py` solve them.
Clamped sheets are in `suite` and `suite.varied`.
"""

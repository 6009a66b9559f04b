"""Cases of bonded pads: what presses, their sensor files and their recordings.

Solved presses ship with the package; `benchmarks/ship_pads.py` solves them. Clamped sheets are in `suite`
and `suite.varied`.
"""

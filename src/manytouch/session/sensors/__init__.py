"""Which sensor a source has: whether a given one fits it, or what its frames show.

`source_checks` compares a sensor and a region with what the source states about itself; `determine_sensor`
reads the first frames, or the whole recording. How a layout is found in frames is in `calibration.rest`.
"""

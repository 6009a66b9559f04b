"""The untouched sheet: rest positions, layout, pose, noise, and doubts about them.

They are computed from the first frames of a recording, or, where its start is touched, from the frames at
rest in the whole of it (`whole_recording`). `calibrate` calibrates a sensor (`rest_calibration` is its
result, `rest_report` its text); `register_rest` and `assumed_sensor` prepare one before it is run.
Mechanical properties of the sheet are not estimated here but in `calibration.sheet`.
"""

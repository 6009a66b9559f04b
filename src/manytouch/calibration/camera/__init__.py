"""Intrinsic parameters of a camera from views of a board, with deviations and a report.

The pose of the camera relative to the sheet is not estimated here but in `calibration.rest`.
"""

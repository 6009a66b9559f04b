"""Receivers of readings: files, pictures, recordings, the viewer.

Each has `write(reading)` and `close()`; which ones a run uses is decided in `manytouch.session`.
"""

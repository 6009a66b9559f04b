"""Metrics: from two evaluated recordings to samples of errors, and from samples to figures with limits.

Reading files and drawing are elsewhere (`evaluated_recordings`, `report`).
"""

"""Metrics: from two records to samples of errors, and from samples to figures with limits.

Reading files and drawing are elsewhere (`records`, `report`).
"""

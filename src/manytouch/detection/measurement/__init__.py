"""Measurement of single dots: sub-pixel centre, covariance, area and contrast around expected positions.

Where to measure is decided elsewhere: by `detection.candidates` for whole images, and by the tracker, which
states expected positions, for windows.
"""

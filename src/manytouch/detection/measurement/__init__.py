"""Measurement of single dots: sub-pixel centre, covariance, area and contrast around expected positions.

Where to measure is decided elsewhere: by `detection.candidates` for whole frames and by the tracker for
windows.
"""

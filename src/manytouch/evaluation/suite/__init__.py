"""The accuracy suite: its cases, their solved states and recordings, and the run over all methods.

The finite elements themselves are in `manytouch.simulation`, the figures in `metrics`.
"""

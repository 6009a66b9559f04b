"""How values are shown in notebooks: HTML tables, and drawings with matplotlib.

Plots of whole results are in `manytouch.analysis`.
"""

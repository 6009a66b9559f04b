"""How values are shown: HTML tables and drawings with matplotlib in notebooks, and words for counts.

Plots of whole results are in `manytouch.analysis`.
"""

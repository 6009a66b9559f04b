"""The report of an evaluation: one HTML page with charts as inline SVG, and `report.json`.

The errors are computed in `metrics`; here they are rated, drawn and written.
"""

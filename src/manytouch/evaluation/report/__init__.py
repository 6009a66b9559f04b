"""The report of an evaluation: one HTML page with figures as inline SVG, and `report.json`.

Figures of merit are computed in `metrics`; here they are rated, drawn and written.
"""

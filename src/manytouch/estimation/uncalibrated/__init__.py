"""Contacts where the view or the sheet was assumed: a load map from dot areas and marker spacings.

The source of the load and the thresholds of its peaks are here; how peaks become contacts is in `load`,
surfaces are in `perimeter`.
"""

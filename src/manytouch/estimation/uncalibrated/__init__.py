"""Contacts where the view or the sheet was assumed: a load map from dot areas and marker spacings.

Only the source of the load is here; how its peaks become contacts is in `load`, surfaces are in `perimeter`.
"""

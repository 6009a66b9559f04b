"""Markers while nothing touches the sheet: their noise, and how far they are from rest at the end.

Both collect readings for `summary`, which writes them to summary.json.
"""

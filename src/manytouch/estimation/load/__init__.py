"""Load maps, which estimate the force density over the sheet without mechanics, and contacts at their peaks.

The maps from the swelling of dots are in `uncalibrated`, the contacts from mechanics in `mechanics`.
"""

"""What a run writes into its result folder: tables, surface.zarr and summary.json, each complete or absent.

The warnings of a run are in `summary`. The format of recordings is in `manytouch.recording`.
"""

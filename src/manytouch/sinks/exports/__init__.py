"""Recordings in the formats of other programs: ROS 2 bags, LeRobot data sets, HDF5, Parquet.

`registry.FORMATS` lists them. A result is complete or absent, and never replaces an existing file.
"""

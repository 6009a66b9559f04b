"""Parts to print and patterns to print: solids, meshes, files, printability, assembly guide.

The dimensions of the sensor are chosen in `manytouch.design`.
"""

"""The published method as a whole: its detection, tracking and estimation, step by step (docs/paper.md).

The method `perimeter`, which combines its depth with the tracking of manytouch, is in `estimation`.
"""

"""Evaluated recordings: one as a method estimated it, or its ground truth, from files or from memory.

How they are compared is in `metrics`.
"""

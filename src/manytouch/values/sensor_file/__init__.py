"""The sensor file (TOML): read with all its mistakes reported at once, and written.

Nothing of the file format is used elsewhere, except that scene files share the checks in `sections`. The
modules that read and write import pydantic, which the others here do without.
"""

"""The paper's own design: its numbers from the tools of this package, and its parts.

`numbers` computes, `write` prints, draws and writes.
The parts are made in `manytouch.design.parts`.
"""

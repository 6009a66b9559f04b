"""The published paper's own experiments, done again on the solid sheet (docs/paper.md).

`material`: Table 1 and Figure 2. `spacing`: Figure 3 and equation 1. `places`: Table 3. `speed`: frames
per second with and without the 3-D map. `page` writes them side by side.
"""

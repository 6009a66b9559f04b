"""How values are shown in notebooks: HTML tables, and drawings with matplotlib."""

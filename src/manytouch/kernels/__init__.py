"""How numba makes the machine code of compiled functions here, where it is kept, and how it is loaded."""

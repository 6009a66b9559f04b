"""What estimators may know of the sheet: its shell, the path from its shape to a dot in the image, and the solver."""

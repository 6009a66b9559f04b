"""What estimators may know of the sheet: its shell, the path from shape to dot in the image, the solver."""

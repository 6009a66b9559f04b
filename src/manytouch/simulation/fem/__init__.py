"""3-D finite elements of the sheet."""

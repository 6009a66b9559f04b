"""What truth is made of: the pressed sheet, the renderer, the simulated sensor."""

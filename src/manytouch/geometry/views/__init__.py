"""Several cameras on one sheet: the sensor of each view, and the markers of all views as those of one."""

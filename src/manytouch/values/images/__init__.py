"""The region of an image that is processed (`roi`), and the grey levels of its pixels (`grey_levels`)."""

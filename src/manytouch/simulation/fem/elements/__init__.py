"""TODO: two sentences: what is inside and what is not."""

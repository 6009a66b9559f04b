"""Results read back from their folders, and plots of results and readings; computes no results itself."""

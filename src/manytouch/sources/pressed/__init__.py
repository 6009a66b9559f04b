"""The simulated sensor that is pressed interactively, in this process or in one of its own."""

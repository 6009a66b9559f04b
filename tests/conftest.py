"""What holds for all tests."""

from hypothesis import settings

# The first example may compile, and a busy machine is slow: time is measured by the benchmarks.
settings.register_profile("unhurried", deadline=None)
settings.load_profile("unhurried")

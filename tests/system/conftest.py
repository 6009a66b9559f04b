"""Real recordings, where they are present next to the repository."""

from pathlib import Path

import pytest

RECORDINGS = Path(__file__).parents[3] / "shared" / "data"


@pytest.fixture(scope="session")
def recordings() -> Path:
    """Folder of the real recordings; the test is skipped where they are absent."""
    if not RECORDINGS.is_dir():
        pytest.skip(f"the real recordings are not here ({RECORDINGS.parent.name}/{RECORDINGS.name})")
    return RECORDINGS

"""Where compiled functions are kept, and a lock for compiling them.

numba keeps them next to the source, or in `NUMBA_CACHE_DIR`. Where that cannot be written they are kept in
the user's cache folder, and where that cannot be written either, in a temporary one for this process alone.
"""

import atexit
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from platformdirs import user_cache_path

SOURCE = Path(__file__).parents[1]


def provide_folder(requested: str) -> str:
    """The value for numba's `CACHE_DIR`.

    Args:
        requested: its present value, empty for the folders next to the sources.

    Returns:
        The requested value if that can be written, else the path of a folder that can.
    """
    if is_writable(Path(requested) if requested else SOURCE / "__pycache__"):
        return requested
    own = user_cache_path("manytouch") / "kernels"
    if is_writable(own):
        return str(own)
    temporary = tempfile.mkdtemp(
        prefix="manytouch-kernels-"
    )  # not shared: a program that can write in it could run code here
    atexit.register(shutil.rmtree, temporary, ignore_errors=True)
    return temporary


def is_writable(folder: Path) -> bool:
    """Whether files can be created in a folder, which is made if it does not exist."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


@contextmanager
def compiling() -> Iterator[None]:
    """Wait while another process of this user compiles; without a lock where the system has none."""
    with ExitStack() as held:
        with suppress(ImportError, OSError):
            import fcntl

            folder = user_cache_path("manytouch", ensure_exists=True)
            file = held.enter_context((folder / "compiling.lock").open("w"))
            fcntl.flock(file, fcntl.LOCK_EX)  # the system releases it when the process ends, however it ends
        yield

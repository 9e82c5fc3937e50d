"""The loops behind the stages: arrays in, arrays out.

Most are compiled by Numba, which keeps the machine code beside the module, or else in the user's cache. Where neither
can be written, as in a container whose installation is read-only and whose user has no home, Numba refuses to import
them; then the code is kept in a temporary folder for as long as the process runs. Set ``NUMBA_CACHE_DIR`` to a folder
that stays, and the compiling of some seconds is not done anew by every process.
"""

from __future__ import annotations

import os
from pathlib import Path


def _can_write_in(folder: Path) -> bool:
    from tempfile import TemporaryFile

    try:
        folder.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


def _find_room_for_machine_code() -> None:
    if "NUMBA_CACHE_DIR" in os.environ or _can_write_in(Path(__file__).parent / "__pycache__"):
        return
    from numba.core import config
    from numba.core.caching import UserWideCacheLocator

    if UserWideCacheLocator.from_function(_can_write_in, __file__) is None:
        import atexit
        import shutil
        import tempfile

        # Numba unpickles what it finds there: the folder must be new and the user's own, not one of a known name.
        folder = tempfile.mkdtemp(prefix="fogpipe-kernels-")
        atexit.register(shutil.rmtree, folder, ignore_errors=True)
        os.environ["NUMBA_CACHE_DIR"] = folder  # processes that this one starts use it, too
        config.reload_config()


_find_room_for_machine_code()

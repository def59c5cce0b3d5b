"""The folder that keeps compiled code between runs."""

from __future__ import annotations

import hashlib
import os
import shutil
import stat
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).parent.parent
MARK = b"distretarget.numerics.compiled import"  # in all files with functions to compile
PRIVATE = 0o700  # permissions of a folder that only its owner may use
UNUSED = 7.0 * 24.0 * 3600.0  # the code of another version is removed after this time without a run that used it [s]


@cache
def code_folder() -> Path | None:
    """Return the folder for the compiled code of this version of the sources; None if no folder can be written to.

    It is in the first of these that can be written to: the folder in the environment variable NUMBA_CACHE_DIR, the
    folder of the package, the cache of the user, and a private folder among the temporary files. The first run of a
    version removes the code of versions that have not run for a week.
    """
    for place in _places():
        with suppress(OSError, RuntimeError):  # RuntimeError: the user has no home
            folder = place() / f"compiled-{_sources_hash()}"
            is_new = not folder.exists()
            folder.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=folder).close()  # which also notes that a run uses the folder
            if is_new:
                _remove_unused(folder)
            return folder
    return None


def _remove_unused(folder: Path) -> None:
    """Remove the folders beside this one with the code of other versions that no run has used for long."""
    for other in folder.parent.glob(f"compiled-{16 * '[0-9a-f]'}"):
        with suppress(OSError):
            status = other.lstat()
            if stat.S_ISDIR(status.st_mode) and time.time() - status.st_mtime > UNUSED:
                shutil.rmtree(other, ignore_errors=True)


def _places() -> Iterator[Callable[[], Path]]:
    """Functions that return the folders to try, in order."""
    if chosen := os.environ.get("NUMBA_CACHE_DIR"):
        yield lambda: Path(chosen)
    yield lambda: PACKAGE / "__pycache__"
    yield lambda: Path.home() / ".cache" / "distretarget"
    yield _private_folder


def _private_folder() -> Path:
    """The folder of this user among the temporary files.

    Raises: OSError: it cannot be made, or other users might put files into it, which would be run.
    """
    if not hasattr(os, "getuid"):  # Windows, where each user has temporary files of their own
        return Path(tempfile.gettempdir()) / "distretarget"
    folder = Path(tempfile.gettempdir()) / f"distretarget-{os.getuid()}"
    folder.mkdir(PRIVATE, exist_ok=True)
    status = folder.lstat()
    if not stat.S_ISDIR(status.st_mode) or status.st_uid != os.getuid() or stat.S_IMODE(status.st_mode) != PRIVATE:
        raise PermissionError(f"{folder} is not private")
    return folder


def _sources_hash() -> str:
    """A hash of all files with functions to compile: a change in one of them may concern callers in another."""
    contents = (path.read_bytes() for path in sorted(PACKAGE.rglob("*.py")))
    return hashlib.sha256(b"".join(content for content in contents if MARK in content)).hexdigest()[:16]

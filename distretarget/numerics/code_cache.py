"""The kept code of a compiled function, for processes that run side by side: one compiles, the others wait for it."""

from __future__ import annotations

import time
from pathlib import Path
from types import CellType, FunctionType
from typing import IO, Any

from numba.core import event
from numba.core.caching import FunctionCache

try:
    import fcntl
except ImportError:  # Windows, where all processes compile for themselves
    fcntl = None  # type: ignore[assignment]

CAN_WAIT = fcntl is not None
WAITING = "distretarget:waiting"  # the event of waiting for another process
LONGEST_WAIT = 60.0  # for another process, after which this one compiles too [s]
PAUSE = 0.02  # between two looks whether the other has ended [s]


class CodeCache(FunctionCache):
    """The folder of compiled code of a function. Loading does not fill numba's registries of what it can compile, which
    takes a tenth of a second: only the compiler needs them, and fills them itself.

    Whoever finds no code locks the function, compiles it, keeps the code and lets the lock go. A process that ends on
    the way lets it go too.
    """

    def __init__(self, function: Any) -> None:
        super().__init__(function)
        self._lock: IO[bytes] | None = None

    @property
    def is_filled(self) -> bool:
        """Whether there is code for any signature."""
        return Path(self._cache_file._index_path).exists()

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Load the code for a signature; None if this process is to compile it."""
        with self._guard_against_spurious_io_errors():
            code = self._load_overload(sig, target_context)
            if code is None and self._locked():
                code = self._load_overload(sig, target_context)  # which another process may have made meanwhile
                if code is not None:
                    self._unlock()
            return code

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep the code for a signature."""
        try:
            super().save_overload(sig, data)
        finally:
            self._unlock()

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        """What code is found by: the signature, the processor, and the names of what the function closes over. numba
        takes their pickles, whose bytes depend on whether Python has read a module from its source or from a .pyc file.
        """
        return sig, codegen.magic_tuple(), tuple(map(_name_of, self._py_func.__closure__ or ()))

    def _locked(self) -> bool:
        """Lock the function, after another process that has locked it; return whether that succeeded."""
        if not CAN_WAIT or self._lock:
            return False
        try:
            self._impl.locator.ensure_cache_path()
            path = Path(self._cache_path, f"{self._impl.filename_base}.lock")
            self._lock = path.open("wb")
            if not _tried(self._lock):
                with event.trigger_event(WAITING):
                    _wait_for(self._lock)
        except OSError:  # a file system without locks
            self._unlock()
        return self._lock is not None

    def _unlock(self) -> None:
        if self._lock:
            self._lock.close()
            self._lock = None


def _name_of(cell: CellType) -> str:
    value = cell.cell_contents
    return f"{value.__module__}.{value.__qualname__}" if isinstance(value, FunctionType) else repr(value)


def _wait_for(file: IO[bytes]) -> None:
    """Lock a file, unless another process keeps it locked for too long."""
    end = time.monotonic() + LONGEST_WAIT
    while not _tried(file) and time.monotonic() < end:
        time.sleep(PAUSE)


def _tried(file: IO[bytes]) -> bool:
    """Lock a file, and return whether no other process has locked it."""
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True

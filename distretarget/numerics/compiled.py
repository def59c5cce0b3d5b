"""Functions compiled by numba, and the folder that keeps their code between runs."""

from __future__ import annotations

import hashlib
import platform
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
import numpy as np
from numba import njit
from numba.core import config as numba_config
from numba.core import event
from numba.extending import register_jitable
from numpy.typing import NDArray

PACKAGE = Path(__file__).parent.parent
MARK = b"distretarget.numerics.compiled import"  # in all files with functions to compile

# Compiled functions allocate no arrays: their callers give those that they write to. So numba need not count references
# to arrays (`_nrt`, see `numba.extending.register_jitable`), and the functions compile and run faster. Nor are they
# passed to other functions as values, for which numba would make another entry point (`no_cfunc_wrapper`).
_OPTIONS: dict[str, Any] = {"error_model": "numpy", "no_cfunc_wrapper": True, "_nrt": False}

config: Any = numba_config  # whose settings have no types

Function = TypeVar("Function", bound=Callable[..., Any])
Value = TypeVar("Value", bound=np.generic)


def compiled(*, fastmath: bool = False) -> Callable[[Function], Function]:
    """Decorate a function that Python calls. It is compiled at its first call, and its code is kept for later runs.

    Several threads may run it at the same time. It is compiled for each kind of arrays (read-only or not, contiguous or
    not), and with `fastmath` the last bits of what these make may differ: then all callers pass arrays of one kind. It
    stands in a module: of a function within a function numba does not always find the kept code.
    """

    def decorate(function: Function) -> Function:
        folder, before = code_folder(), config.CACHE_DIR
        config.CACHE_DIR = str(folder)
        try:
            return cast(Function, njit(fastmath=fastmath, nogil=True, cache=bool(folder), **_OPTIONS)(function))
        finally:
            config.CACHE_DIR = before

    return decorate


def inlined(*, fastmath: bool = False) -> Callable[[Function], Function]:
    """Decorate a function that compiled functions call. Its code becomes a part of theirs; Python that calls it runs it
    as it is written.

    If its code did not become a part of theirs, a process that compiles would run another copy of it than a process
    that loads its callers from the folder of compiled code, and results could differ in their last bits.
    """
    return register_jitable(fastmath=fastmath, forceinline=True, **_OPTIONS)


def merged(function: Function) -> Function:
    """Decorate a function that one compiled function calls. Its source becomes a part of that one's, with the same
    options, and is compiled there alone; Python that calls it compiles it anew in every run.

    An `inlined` function is compiled by itself first, which a large one takes long for.
    """
    return cast(Function, njit(inline="always", **_OPTIONS)(function))


def read_only(array: NDArray[Value]) -> NDArray[Value]:
    """Return a view that cannot be written to, so that a function is compiled once for arrays that can and cannot."""
    view = array.view()
    view.flags.writeable = False
    return view


@cache
def code_folder() -> Path | None:
    """Return the folder for the compiled code of this version of the sources; None if no folder can be written to.

    It is in the first of these that can be written to: the folder in the environment variable NUMBA_CACHE_DIR, the
    folder of the package, and the cache of the user. numba would take code for up to date when only a function that
    becomes a part of it has changed, in another file.
    """
    for place in (config.CACHE_DIR, PACKAGE / "__pycache__", "~/.cache/distretarget"):
        with suppress(OSError, RuntimeError):  # RuntimeError: the user has no home
            if place:
                folder = Path(place).expanduser() / f"compiled-{_version()}"
                folder.mkdir(parents=True, exist_ok=True)
                tempfile.TemporaryFile(dir=folder).close()
                return folder
    return None


def _version() -> str:
    """A hash of all files with functions to compile, and of the versions of Python and numba."""
    contents = (path.read_bytes() for path in sorted(PACKAGE.rglob("*.py")))
    versions = platform.python_version() + numba.__version__
    sources = b"".join(content for content in contents if MARK in content)
    return hashlib.sha256(versions.encode() + sources).hexdigest()[:16]


@contextmanager
def announced_compilation(tell: Callable[[str], object]) -> Iterator[None]:
    """Call `tell` with a line for the user before the first function is compiled, if any is."""
    with event.install_listener("numba:compile", _Announcer(tell)):
        yield


class _Announcer(event.Listener):
    """Tells of the first compilation."""

    def __init__(self, tell: Callable[[str], object]) -> None:
        self._tell = tell
        self._told = False

    def on_start(self, event: event.Event) -> None:  # noqa: ARG002
        if not self._told:
            self._told = True
            self._tell(_announcement())

    def on_end(self, event: event.Event) -> None:
        """Do nothing."""


def _announcement() -> str:
    if folder := code_folder():
        return f"compiling for the first run, which takes about 14 s; later runs find the code in {folder}"
    return (
        "compiling, which takes about 14 s in every run, as there is no folder to keep the code in; "
        "set NUMBA_CACHE_DIR to a folder that can be written to"
    )

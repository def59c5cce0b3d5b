"""Functions compiled by numba: those that Python calls, and those that become parts of them."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np
from numba import njit
from numba.core import config, event
from numba.extending import register_jitable
from numpy.typing import NDArray

from distretarget.numerics.code_cache import WAITING, CodeCache
from distretarget.numerics.code_folder import code_folder
from distretarget.numerics.inlining import InlinedCompiler

# Compiled functions allocate no arrays: their callers give those that they write to. So numba need not count references
# to arrays, and the functions compile and run faster.
_OPTIONS: dict[str, Any] = {"error_model": "numpy", "no_cfunc_wrapper": True, "_nrt": False}

Function = TypeVar("Function", bound=Callable[..., Any])
Value = TypeVar("Value", bound=np.generic)


def compiled(*, fastmath: bool = False) -> Callable[[Function], Function]:
    """Decorate a function that Python calls. It is compiled at its first call, and its code is kept for later runs.

    Several threads may run it at the same time. It is compiled for each kind of arrays (read-only or not, contiguous or
    not), and with `fastmath` the last bits of what these make may differ: then all callers pass arrays of one kind.
    """

    def decorate(function: Function) -> Function:
        code: Any = njit(fastmath=fastmath, nogil=True, **_OPTIONS)(function)
        if folder := code_folder():
            with _caching_in(folder):
                code._cache = CodeCache(function)
        return cast(Function, code)

    return decorate


@contextmanager
def _caching_in(folder: Path) -> Iterator[None]:
    """Let numba keep code in a folder, in the functions for which caching is enabled meanwhile."""
    settings: Any = config
    before, settings.CACHE_DIR = settings.CACHE_DIR, str(folder)
    try:
        yield
    finally:
        settings.CACHE_DIR = before


class _CollectionPaused(event.Listener):
    """Pauses Python's garbage collection while a function of this package is compiled, which takes a tenth of it."""

    def __init__(self) -> None:
        self._depth = 0
        self._was_on = False

    def on_start(self, event: event.Event) -> None:
        if _is_of_package(event):
            if not self._depth:
                self._was_on = gc.isenabled()
                gc.disable()
            self._depth += 1

    def on_end(self, event: event.Event) -> None:
        if _is_of_package(event):
            self._depth -= 1
            if not self._depth and self._was_on:
                gc.enable()


def _is_of_package(compilation: event.Event) -> bool:
    function = compilation.data["dispatcher"].py_func
    return str(function.__module__).partition(".")[0] == __name__.partition(".")[0]


event.register("numba:compile", _CollectionPaused())


def is_to_be_compiled(function: Callable[..., Any]) -> bool:
    """Return whether no code of a compiled function is kept yet, but will be."""
    cache = getattr(function, "_cache", None)
    return not getattr(config, "DISABLE_JIT", 0) and isinstance(cache, CodeCache) and not cache.is_filled


def read_only(array: NDArray[Value]) -> NDArray[Value]:
    """Return a view that cannot be written to, so that a function is compiled once for arrays that can and cannot."""
    view = array.view()
    view.flags.writeable = False
    return view


def inlined(*, fastmath: bool = False) -> Callable[[Function], Function]:
    """Decorate a function that compiled functions call. Its code becomes a part of theirs; Python that calls it runs it
    as it is written.

    If its code did not become a part of theirs, a process that compiles would run another copy of it than a process
    that loads its callers from the folder of compiled code, and results could differ in their last bits.
    """
    options = {"forceinline": True, "no_cpython_wrapper": True, "pipeline_class": InlinedCompiler}
    return register_jitable(fastmath=fastmath, **options, **_OPTIONS)


@contextmanager
def announced_compilation(tell: Callable[[str], object]) -> Iterator[None]:
    """Call `tell` with a line for the user before the first function is compiled, by this process or by another that it
    waits for, if any is.
    """
    announcer = _Announcer(tell)
    with event.install_listener("numba:compile", announcer), event.install_listener(WAITING, announcer):
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
        return f"compiling for the first run, which takes about 10 s; later runs find the code in {folder}"
    return (
        "compiling, which takes about 10 s in every run, as there is no folder to keep the code in; "
        "set NUMBA_CACHE_DIR to a folder that can be written to"
    )

"""Functions compiled by numba, and the folder that keeps their code between runs.

numba is imported when the first of them is called: what needs none of them, such as `--help`, does not wait for it.
"""

from __future__ import annotations

import functools
import hashlib
import os
import platform
import stat
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from functools import cache
from importlib.metadata import version
from pathlib import Path
from types import FunctionType
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from distretarget.numerics.vectors import Array

PACKAGE = Path(__file__).parent.parent
MARK = b"distretarget.numerics.compiled import"  # in all files with functions to compile

# Compiled functions allocate no arrays: their callers give those that they write to. So numba need not count references
# to arrays (`_nrt`, see `numba.extending.register_jitable`), and the functions compile and run faster. Nor are they
# passed to other functions as values, for which numba would make another entry point (`no_cfunc_wrapper`).
_OPTIONS: dict[str, Any] = {"error_model": "numpy", "no_cfunc_wrapper": True, "_nrt": False}

FEW = 200_000  # numbers that Python computes with sooner than numba is imported

Function = TypeVar("Function", bound=Callable[..., Any])
Value = TypeVar("Value", bound=np.generic)

_inlined: list[tuple[Callable[..., Any], bool]] = []  # functions that numba does not know yet, and whether fastmath
_merged: dict[Callable[..., Any], Any] = {}  # functions, and what numba makes of them; None while it does not know them
_lock = threading.Lock()  # while functions are made known to numba
_light = ContextVar("_light", default=False)  # whether functions on few numbers run as Python
_tellers: list[Callable[[str], object]] = []  # are told of the first compilation


def compiled(*, fastmath: bool = False) -> Callable[[Function], Function]:
    """Decorate a function that Python calls. It is compiled at its first call, and its code is kept for later runs.

    Several threads may run it at the same time. It is compiled for each kind of arrays (read-only or not, contiguous or
    not), and with `fastmath` the last bits of what these make may differ: then all callers pass arrays of one kind. It
    stands in a module: of a function within a function numba does not always find the kept code.
    """

    def decorate(function: Function) -> Function:
        code: Callable[..., Any] | None = None

        @functools.wraps(function)
        def call(*arguments: Any) -> Any:
            nonlocal code
            if code is None:
                if runs_as_python(sum(each.size for each in arguments if isinstance(each, np.ndarray))):
                    with np.errstate(all="ignore"):
                        return function(*arguments)
                with _lock:
                    code = code or _code_of(function, fastmath)
            return code(*arguments)

        return cast(Function, call)

    return decorate


@contextmanager
def uncompiled() -> Iterator[None]:
    """Run functions on few numbers as Python in the block, unless numba is imported: for what has to start at once."""
    before = _light.set(True)
    try:
        yield
    finally:
        _light.reset(before)


def runs_as_python(numbers: int) -> bool:
    """Return whether a compiled function runs as Python on arrays with so many numbers."""
    return _light.get() and numbers <= FEW and "numba" not in sys.modules


def inlined(*, fastmath: bool = False) -> Callable[[Function], Function]:
    """Decorate a function that compiled functions call. Its code becomes a part of theirs, or a process that compiles
    would run another copy of it than one that loads kept code, and results could differ in their last bits. Python that
    calls it runs it as it is written.
    """

    def decorate(function: Function) -> Function:
        _inlined.append((function, fastmath))
        return function

    return decorate


def merged(function: Function) -> Function:
    """Decorate a function that one compiled function calls. Its source becomes a part of that one's, with the same
    options: an `inlined` function is compiled by itself first, which a large one takes long for. Python runs it as it
    is written.
    """
    _merged[function] = None
    return function


def introduced(function: Function) -> Function:
    """Decorate a function for numba: make known to numba what it may call, `inlined` and `merged` functions."""
    from numba import njit
    from numba.extending import register_jitable

    while _inlined:
        each, is_fast = _inlined.pop()
        register_jitable(fastmath=is_fast, forceinline=True, **_OPTIONS)(each)
    for each in [each for each, made in _merged.items() if made is None]:
        _merged[each] = njit(inline="always", **_OPTIONS)(each)
    _name_merged(function)
    for other in _merged:
        _name_merged(other)
    return function


def _code_of(function: Callable[..., Any], fastmath: bool) -> Any:
    """What numba makes of a function."""
    from numba import njit
    from numba.core import config

    from distretarget.numerics.kept_code import KeptCode

    introduced(function)
    _announce()
    settings: Any = config
    folder, before = code_folder(), settings.CACHE_DIR
    settings.CACHE_DIR = str(folder)
    made = njit(fastmath=fastmath, nogil=True, **_OPTIONS)(function)
    try:
        if folder:
            made._cache = KeptCode(function)
        return made
    finally:
        settings.CACHE_DIR = before


def _name_merged(function: Callable[..., Any]) -> None:
    """Let the names of `merged` functions in a function stand for what numba made of them."""
    assert isinstance(function, FunctionType)
    names = function.__globals__
    for name in function.__code__.co_names:
        if _is_merged(names.get(name)):
            names[name] = _merged[names[name]]
    for cell in function.__closure__ or ():
        if _is_merged(cell.cell_contents):
            cell.cell_contents = _merged[cell.cell_contents]


def _is_merged(value: object) -> bool:
    return isinstance(value, FunctionType) and value in _merged


def read_only(array: NDArray[Value]) -> NDArray[Value]:
    """Return a view that cannot be written to, so that a function is compiled once for arrays that can and cannot."""
    view = array.view()
    view.flags.writeable = False
    return view


def contiguous(array: NDArray[Value]) -> NDArray[Value]:
    """Return a `read_only` view of an array, or of a contiguous copy of it."""
    return read_only(np.ascontiguousarray(array))


@cache
def code_folder() -> Path | None:
    """Return the folder for the compiled code of this version of the sources; None if no folder can be written to.

    It is the first that can be written to, and by nobody but this user, since code that is found there is run: in the
    environment variable NUMBA_CACHE_DIR, in the package, or in the cache of the user. numba would take code for up to
    date when only a function that becomes a part of it has changed, in another file.
    """
    places = (os.environ.get("NUMBA_CACHE_DIR"), str(PACKAGE / "__pycache__"), "~/.cache/distretarget")
    for place in filter(None, places):
        with suppress(OSError, RuntimeError):  # the user has no home
            folder = Path(place).expanduser().resolve() / f"compiled-{_version()}"
            folder.mkdir(0o700, parents=True, exist_ok=True)
            folder = folder.resolve()
            if is_private(folder):
                tempfile.TemporaryFile(dir=folder).close()
                return folder
    return None


def is_private(folder: Path) -> bool:
    """Return whether nobody but this user and the administrator can put files into a folder or replace it, by the
    owners and permissions of the folder and of those above it; True on Windows, which has other permissions.
    """
    if not hasattr(os, "getuid"):
        return True
    statuses = [path.stat() for path in (folder, *folder.parents)]
    owned = all(status.st_uid in (0, os.getuid()) for status in statuses)
    above = [status for status in statuses[1:] if not status.st_mode & stat.S_ISVTX]  # in /tmp nobody replaces it
    return owned and not any(map(_is_open, [statuses[0], *above]))


def _is_open(status: os.stat_result) -> bool:
    """Whether others can write to a folder."""
    by_group = status.st_mode & stat.S_IWGRP and _is_shared(status.st_gid)
    return bool(status.st_mode & stat.S_IWOTH or by_group)


def _is_shared(group: int) -> bool:
    """Whether a group may have other members than this user: not if it is named after the user and lists no others."""
    import grp
    import pwd

    try:
        user, found = pwd.getpwuid(os.getuid()).pw_name, grp.getgrgid(group)
    except KeyError:
        return True
    return found.gr_name != user or not {*found.gr_mem} <= {user}


def _version() -> str:
    """A hash of all files with functions to compile, and of the versions of Python and numba."""
    contents = (path.read_bytes() for path in sorted(PACKAGE.rglob("*.py")))
    versions = platform.python_version() + version("numba")
    sources = b"".join(content for content in contents if MARK in content)
    return hashlib.sha256(versions.encode() + sources).hexdigest()[:16]


@contextmanager
def announced_compilation(tell: Callable[[str], object]) -> Iterator[None]:
    """Call `tell` with a line for the user before the first function is compiled, if any is."""
    _tellers.append(tell)
    try:
        yield
    finally:
        with suppress(ValueError):  # it has been called
            _tellers.remove(tell)


@cache
def _announce() -> None:
    """Let numba tell of compilations."""
    from numba.core import event

    class Announcer(event.Listener):
        def on_start(self, event: event.Event) -> None:  # noqa: ARG002
            while _tellers:
                _tellers.pop()(_announcement())

        def on_end(self, event: event.Event) -> None:
            """Do nothing."""

    event.register("numba:compile", Announcer())


def _announcement() -> str:
    if folder := code_folder():
        return f"compiling for the first run, which takes 10 to 30 s; later runs find the code in {folder}"
    return (
        "compiling, which takes 10 to 30 s in every run, as there is no folder to keep the code in; "
        "set NUMBA_CACHE_DIR to a folder that only you can write to"
    )


@inlined()
def copy_to(target: Array, source: Array) -> None:
    """target[:] = source, for contiguous arrays of one shape."""
    flat_source, flat_target = source.flat, target.flat
    for i in range(source.size):
        flat_target[i] = flat_source[i]


@inlined()
def clear(array: NDArray[Any]) -> None:
    """array[:] = 0, for a contiguous array."""
    flat = array.flat
    for i in range(array.size):
        flat[i] = 0


@inlined()
def indices(first: int, end: int) -> range:
    """range(first, end), not negative, as unsigned integers: numba vectorises loops over these."""
    return range(np.uintp(first), np.uintp(end))

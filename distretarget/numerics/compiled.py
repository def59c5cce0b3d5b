"""Functions that are compiled when the package is built (`numerics.build`), and the library with their code.

The library is loaded when the first of them is called. It takes the addresses of numpy's arrays and Python's floats.
"""

from __future__ import annotations

import ctypes
import functools
import hashlib
import json
import platform
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, TypeVar, cast

import numpy as np

from distretarget.errors import LibraryError

PACKAGE = Path(__file__).parent.parent
LIBRARY = Path(__file__).with_name("kernels" + {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so"))
MANIFEST = LIBRARY.with_suffix(".json")  # platform, digests of library and sources, argument types of functions
# The instruction sets that code for a kind of processor needs, by numpy's names since its release 2.4, and before.
INSTRUCTIONS = {"x86-64-v3": ({"X86_V3"}, {"AVX2", "FMA3"})}

Function = TypeVar("Function", bound=Callable[..., Any])
T = TypeVar("T")


@dataclass(frozen=True)
class ArrayKind:
    """A kind of contiguous arrays that a compiled function takes: dtype and number of axes."""

    dtype: str
    axes: int


WRITTEN = "written"
Out = Annotated[T, WRITTEN]  # an array that the function writes to
functions: list[Any] = []  # compiled functions, each with whether it uses fastmath; so are inlined ones
inlined_functions: list[tuple[Callable[..., Any], bool]] = []


def compiled(*, fastmath: bool = False) -> Callable[[Function], Function]:
    """Decorate a function that Python calls. Its module imports only numpy, the standard library and such modules.

    Its arguments are annotated as float, int, bool, arrays (`numerics.vectors`: F2, I1, ...; `Out` if it writes to
    them) or named tuples of these; it returns None or an int. It allocates nothing: it writes to arrays of the caller,
    which overlap no others that it uses. No index is negative. Several threads may run it at the same time.
    `__wrapped__` is the Python function.

    Raises:
        TypeError: an argument is of another type.
        LibraryError: the library cannot be loaded.
    """

    def decorate(function: Function) -> Function:
        found: tuple[Callable[..., int], list[Any]] | None = None
        returns = function.__annotations__["return"] == "int"

        @functools.wraps(function)
        def call(*arguments: Any) -> int | None:
            nonlocal found
            found = found or loaded().entry(function)
            given = _checked(function, arguments, found[1])
            result = found[0]((ctypes.py_object * len(given))(*given))
            return result if returns else None

        functions.append((call, fastmath))
        return cast(Function, call)

    return decorate


def inlined(*, fastmath: bool = False) -> Callable[[Function], Function]:
    """Decorate a function that is inlined into compiled functions; Python calls the function itself."""

    def decorate(function: Function) -> Function:
        inlined_functions.append((function, fastmath))
        return function

    return decorate


def _checked(function: Callable[..., Any], arguments: tuple[Any, ...], kinds: list[Any]) -> list[Any]:
    """The arrays and, as floats, the numbers in the arguments and their tuples; a TypeError for other `kinds`."""
    given: list[Any] = []
    _collect(arguments, given)
    for n, (each, kind) in enumerate(zip(given, kinds, strict=False)):
        if kind is None:
            given[n] = float(each)
        elif type(each) is not np.ndarray or each.dtype != kind[0] or each.ndim != kind[1] or kind[2] & ~each.flags.num:
            found = f"{each.dtype} {each.shape}, flags {each.flags.num:#x}" if hasattr(each, "flags") else repr(each)
            expected = f"{kind[0]} with {kind[1]} axes, flags {kind[2]:#x}"
            raise TypeError(f"{function.__qualname__}: array {n} is {found}; expected {expected}")
    if len(given) != len(kinds):
        raise TypeError(f"{function.__qualname__} takes {len(kinds)} arrays and numbers, not {len(given)}")
    return given


def _collect(arguments: tuple[Any, ...], given: list[Any]) -> None:
    for each in arguments:
        if isinstance(each, tuple):
            _collect(each, given)
        else:
            given.append(each)


@dataclass(frozen=True)
class Library:
    """The loaded library, the kind of processor whose code is used, and the argument types of its functions."""

    code: ctypes.CDLL
    cpu: str
    types: dict[str, list[Any]]

    def entry(self, function: Callable[..., Any]) -> tuple[Any, list[Any]]:
        """Return the code of a function, and the kinds of its arguments: dtype, axes, flags, or None for a number."""
        name = symbol_of(function)
        if name not in self.types:
            raise LibraryError(LIBRARY, f"has no code of {function.__module__}.{function.__qualname__}", _remedy())
        kinds = [None if isinstance(kind, str) else (np.dtype(kind[0]), *kind[1:]) for kind in self.types[name]]
        code = self.code[f"{self.cpu.replace('-', '_')}_{name}"]
        code.restype = ctypes.c_int64
        return code, kinds


@functools.cache
def loaded() -> Library:
    """Load the library, with the best code that this processor can run."""
    try:
        known, content = json.loads(MANIFEST.read_bytes()), LIBRARY.read_bytes()
        if known["platform"] != this_platform():
            raise LibraryError(LIBRARY, f"is for {known['platform']}, and this is {this_platform()}", _remedy())
        if known["digest"] != digest(content):
            raise LibraryError(LIBRARY, "is damaged", _remedy())
        if changed := [name for name, old in known["sources"].items() if _differs(PACKAGE / name, old)]:
            raise LibraryError(LIBRARY, f"is older than {PACKAGE / changed[0]}", _remedy())
        code = ctypes.CDLL(str(LIBRARY))
    except FileNotFoundError:
        raise LibraryError(LIBRARY, "is missing", _remedy()) from None
    except (OSError, ValueError) as error:
        raise LibraryError(LIBRARY, f"cannot be loaded here ({error})", _remedy()) from None
    # numpy's C interface fixes the layout after the head of an object; its size depends on the build of Python.
    head, example = object.__basicsize__, np.zeros(1)
    if (
        sys.implementation.name != "cpython"
        or ctypes.c_void_p.from_address(id(example) + head).value != example.ctypes.data
    ):
        raise LibraryError(LIBRARY, f"needs CPython, and this is {platform.python_implementation()}", _remedy())
    cpu = next(cpu for cpu in known["cpus"] if _can_run(cpu))
    ctypes.c_int64.in_dll(code, f"{cpu.replace('-', '_')}_head").value = head
    return Library(code, cpu, known["functions"])


def _differs(path: Path, old: str) -> bool:
    """Whether a source file exists and differs from the one that was compiled."""
    return path.exists() and digest(path.read_bytes()) != old


def _can_run(cpu: str) -> bool:
    """Whether this processor can run code for a kind of processor."""
    extensions: Any = np.show_config(mode="dicts")["SIMD Extensions"]
    found = {*extensions.get("baseline", ()), *extensions.get("found", ())}
    return any(needed <= found for needed in INSTRUCTIONS.get(cpu, [set()]))


def _remedy() -> str:
    root = PACKAGE.parent
    return f"pip install {f'-e {root}' if (root / 'pyproject.toml').is_file() else '--force-reinstall distretarget'}"


def this_platform() -> str:
    """Return the system and the processor, such as linux-x86_64."""
    machine = platform.machine().lower()
    return f"{sys.platform}-{ {'amd64': 'x86_64', 'arm64': 'aarch64'}.get(machine, machine) }"


def symbol_of(function: Callable[..., Any]) -> str:
    """Return the symbol of a function in the library, without the prefix of the kind of processor."""
    return f"{function.__module__}_{function.__qualname__}".removeprefix("distretarget.").replace(".", "_")


def digest(content: bytes) -> str:
    """Return a hash of a file's content that does not depend on its line ends."""
    return hashlib.sha256(content.replace(b"\r\n", b"\n")).hexdigest()

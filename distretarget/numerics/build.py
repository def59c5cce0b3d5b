"""Build the library of compiled functions: numba compiles them, llvmlite makes an object for each kind of processor.

    python -m distretarget.numerics.build FOLDER [PLATFORM]

It needs numba, and a linker: the system's `cc`, or for other platforms the package ziglang. `hatch_build.py` runs it.
"""

from __future__ import annotations

import functools
import importlib
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any, NamedTuple, get_args, get_origin, get_type_hints

import numpy as np

from distretarget.numerics import compiled
from distretarget.numerics.compiled import LIBRARY, MANIFEST, PACKAGE, WRITTEN, digest, symbol_of, this_platform


class Platform(NamedTuple):
    """A system and processor that the library can be for."""

    triple: str  # LLVM's name of it
    zig: str  # zig's name of it
    wheel: str  # the platform tag of wheels
    library: str  # the ending of libraries
    cpus: tuple[str, ...]  # kinds of processor, the best first


X86 = "x86-64-v3", "x86-64"
PLATFORMS = {
    "linux-x86_64": Platform("x86_64-linux-gnu", "x86_64-linux-gnu.2.17", "manylinux_2_17_x86_64", ".so", X86),
    "linux-aarch64": Platform(
        "aarch64-linux-gnu", "aarch64-linux-gnu.2.17", "manylinux_2_17_aarch64", ".so", ("generic",)
    ),
    "darwin-x86_64": Platform("x86_64-apple-macosx10.13", "x86_64-macos", "macosx_10_13_x86_64", ".dylib", X86),
    "darwin-aarch64": Platform("arm64-apple-macosx11.0", "aarch64-macos", "macosx_11_0_arm64", ".dylib", ("apple-m1",)),
    "win32-x86_64": Platform("x86_64-pc-windows-gnu", "x86_64-windows-gnu", "win_amd64", ".dll", X86),
}
FEATURES = {"x86-64-v3": "+avx,+avx2,+bmi,+bmi2,+cx16,+f16c,+fma,+lzcnt,+movbe,+popcnt,+sahf,+sse4.2,+xsave"}
EXTERNAL = {"cos", "sin", "sqrt"}  # system functions that the library may call, besides those that LLVM adds
CONTIGUOUS, ALIGNED, WRITEABLE = 0x1, 0x100, 0x400  # numpy's flags of arrays
NUMBERS = {"int64": ("i64", "fptosi"), "bool": ("i1", "fptoui"), "float64": ("double", "")}  # from Python's floats
SHAPE, STRIDES = 16, 24  # their offsets in numpy's arrays, from the data pointer, which follows the object's head


def build(folder: Path, other: str | None = None) -> str:
    """Write the library and its manifest to a folder, for this or another platform; return a line about it.

    Raises:
        SystemExit: the platform is unknown, a function does not compile, or there is no linker.
    """
    platform = other or this_platform()
    if platform not in PLATFORMS:
        raise SystemExit(f"distretarget: {platform} is unknown; expected one of {', '.join(PLATFORMS)}")
    target, is_own = PLATFORMS[platform], platform == this_platform()
    with tempfile.TemporaryDirectory() as scratch:
        objects = [Path(scratch, f"{cpu}.o") for cpu in target.cpus]
        calls = []
        for path, cpu in zip(objects, target.cpus, strict=True):
            own = cpu if is_own or (this_platform().endswith("x86_64") and cpu in X86) else ""
            command = [sys.executable, "-m", "distretarget.numerics.build", "--object", str(path), target.triple, cpu]
            settings = {"NUMBA_CPU_NAME": own or "generic", "NUMBA_CPU_FEATURES": FEATURES.get(own, "")}
            calls.append(subprocess.Popen(command, env=os.environ | settings | {"NUMBA_DISABLE_INTEL_SVML": "1"}))
        if any(list(map(subprocess.Popen.wait, calls))):
            raise SystemExit("distretarget: its functions do not compile")
        library = Path(scratch, f"library{target.library}")
        _link(objects, library, target.zig if other else None)
        content = library.read_bytes()
        types = json.loads(objects[0].with_suffix(".json").read_bytes())
    known = {"platform": platform, "cpus": target.cpus, "digest": digest(content), "functions": types}
    known["sources"] = {path.relative_to(PACKAGE).as_posix(): digest(path.read_bytes()) for path in _sources()}
    (folder / LIBRARY.name).with_suffix(target.library).write_bytes(content)
    (folder / MANIFEST.name).write_text(json.dumps(known) + "\n")
    return f"{platform}: {len(types)} functions for {' and '.join(target.cpus)} in {len(content):,} bytes"


def _sources() -> list[Path]:
    """The files with functions to compile."""
    is_one = re.compile(rb"^@(compiled|inlined)\(", re.MULTILINE)
    return [path for path in sorted(PACKAGE.rglob("*.py")) if is_one.search(path.read_bytes())]


def _link(objects: list[Path], library: Path, zig: str | None) -> None:
    """Link by the system's compiler; by zig for another platform, or without a compiler."""
    if zig is None and shutil.which("cc"):
        command = ["cc"]
    elif find_spec("ziglang"):
        command = [sys.executable, "-m", "ziglang", "cc", *(["-target", zig] if zig else [])]
    else:
        raise SystemExit("distretarget: to link its functions, install a C compiler (cc) or the package ziglang")
    caches = {f"ZIG_{kind}_CACHE_DIR": str(library.parent) for kind in ("GLOBAL", "LOCAL")}
    subprocess.run([*command, "-shared", "-o", library, *objects, "-lm"], check=True, env=os.environ | caches)


def write_object(path: Path, triple: str, cpu: str) -> None:
    """Write an object file of all functions for a kind of processor, and the types of their arguments as JSON."""
    import llvmlite.binding as llvm

    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    machine = llvm.Target.from_triple(triple).create_target_machine(cpu, FEATURES.get(cpu, ""), 3, "pic", "default")
    prefix = f"{cpu.replace('-', '_')}_"
    head = f'target triple = "{triple}"\ntarget datalayout = "{machine.target_data}"\n'
    whole, types = llvm.parse_assembly(f"{head}@{prefix}head = dllexport global i64 0"), {}
    for symbol, name, text, leaves in _compile():
        types[symbol] = leaves
        entry = _entry(f"{prefix}{symbol}", f"{prefix}head", name, leaves)
        text = re.sub(r"^target .*$", "", text, flags=re.MULTILINE)
        whole.link_in(llvm.parse_assembly(f"{head}{text}\n@{prefix}head = external global i64{entry}"))
    for each in (*whole.functions, *whole.global_variables):
        if not each.is_declaration and each.storage_class != llvm.StorageClass.dllexport:
            each.linkage = "internal"
    passes = llvm.create_new_module_pass_manager()
    passes.add_global_dead_code_eliminate_pass()
    passes.add_strip_dead_prototype_pass()
    passes.run(whole, llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options()))
    external = {each.name for each in whole.functions if each.is_declaration and not each.name.startswith("llvm.")}
    if external - EXTERNAL:
        raise SystemExit(f"distretarget: not every system has {', '.join(sorted(external - EXTERNAL))}")
    path.write_bytes(machine.emit_object(whole))
    path.with_suffix(".json").write_text(json.dumps(types))


def _compile() -> Iterator[tuple[str, str, str, list[Any]]]:
    """Yield each function that Python calls: its symbol, its name in LLVM IR, its IR with all functions that it calls,
    and its arguments (`_leaves`).
    """
    from numba import intp
    from numba.core import compiler, compiler_lock, cpu_options, registry
    from numba.np import arrayobj

    # No index is negative (`compiled`), so none is compared with zero.
    arrayobj.fix_integer_index = lambda context, builder, kind, index, _: context.cast(builder, index, kind, intp)
    for path in _sources():
        importlib.import_module(".".join(("distretarget", *path.relative_to(PACKAGE).with_suffix("").parts)))
    register_inlined()
    contexts = registry.cpu_target.typing_context, registry.cpu_target.target_context
    contexts[1].refresh()
    for call, fastmath in compiled.functions:
        flags, function = compiler.Flags(), call.__wrapped__
        flags.error_model, flags.fastmath = "numpy", cpu_options.FastMathOptions(fastmath)
        flags.no_compile = flags.no_cpython_wrapper = flags.no_cfunc_wrapper = flags.noalias = True
        hints = get_type_hints(function, include_extras=True)
        hints.pop("return")
        types = [_numba_type(hint, WRITTEN in get_args(hint)) for hint in hints.values()]
        made = compiler.compile_extra(*contexts, function, types, None, flags, {})
        with compiler_lock.global_compiler_lock:
            made.library.finalize()
        written = [CONTIGUOUS | ALIGNED | WRITEABLE * getattr(each, "mutable", False) for each in types]
        leaves = [leaf for each in zip(types, written, strict=True) for leaf in _leaves(*each)]
        yield symbol_of(function), made.fndesc.mangled_name, made.library.get_llvm_str(), leaves


def register_inlined() -> None:
    """Register inlined functions with numba; no array is allocated, so no references are counted."""
    from numba.extending import register_jitable

    while compiled.inlined_functions:
        function, fastmath = compiled.inlined_functions.pop()
        register_jitable(fastmath=fastmath, forceinline=True, error_model="numpy", _nrt=False)(function)


def _numba_type(hint: Any, written: bool) -> Any:
    """The numba type of a type hint; arrays in tuples may be written to."""
    from numba import from_dtype, types

    if get_origin(hint) is Annotated:
        kind = get_args(hint)[1]
        return types.Array(from_dtype(np.dtype(kind.dtype)), kind.axes, "C", readonly=not written)
    if hasattr(hint, "_fields"):
        fields = get_type_hints(hint, include_extras=True).values()
        return types.BaseTuple.from_types([_numba_type(field, True) for field in fields], hint)
    return {int: types.int64, float: types.float64, bool: types.boolean}[hint]


def _leaves(given: Any, flags: int) -> Iterator[Any]:
    """Yield dtype, axes and flags of each array in a numba type, and the name of the type of each number."""
    if hasattr(given, "layout"):
        yield given.dtype.name.replace("boolean", "bool"), given.ndim, flags
    elif hasattr(given, "types"):
        for each in given.types:
            yield from _leaves(each, CONTIGUOUS | ALIGNED)
    else:
        yield given.name


def _entry(symbol: str, head: str, name: str, leaves: list[Any]) -> str:
    """The entry function in LLVM IR: it takes a list of addresses of arrays and floats, and calls the function `name`
    with their content. numba passes an array as two owners, number and size of items, data, shape and strides.
    """
    lines: list[str] = []

    def made(text: str) -> str:
        lines.append(f"%t{len(lines)} = {text}")
        return f"%t{len(lines) - 1}"

    def at(place: str, offset: int, kind: str = "ptr") -> str:
        return made(f"load {kind}, ptr {made(f'getelementptr i8, ptr {place}, i64 {offset}')}")

    size, given = made(f"load i64, ptr @{head}"), [f"ptr {made('alloca i64')}", f"ptr {made('alloca ptr')}"]
    for n, leaf in enumerate(leaves):
        body = made(f"getelementptr i8, ptr {at('%values', 8 * n)}, i64 {size}")
        if isinstance(leaf, str):
            value, (kind, how) = at(body, 0, "double"), NUMBERS[leaf]
            given.append(f"{kind} {made(f'{how} double {value} to {kind}') if how else value}")
            continue
        lengths, strides = (
            [at(at(body, field), 8 * axis, "i64") for axis in range(leaf[1])] for field in (SHAPE, STRIDES)
        )
        count = functools.reduce(lambda one, other: made(f"mul i64 {one}, {other}"), lengths)
        given += ["ptr null", "ptr null", f"i64 {count}", f"i64 {np.dtype(leaf[0]).itemsize}", f"ptr {at(body, 0)}"]
        given += [f"i64 {word}" for word in lengths + strides]
    made(f'call i32 @"{name}"({", ".join(given)})')
    lines.append(f"ret i64 {at(given[0].removeprefix('ptr '), 0, 'i64')}")
    return f"\ndefine dllexport i64 @{symbol}(ptr %values) {{\n{chr(10).join(lines)}\n}}\n"


if __name__ == "__main__":
    if sys.argv[1] == "--object":
        write_object(Path(sys.argv[2]), *sys.argv[3:])
    else:
        print(build(Path(sys.argv[1]), *sys.argv[2:]))

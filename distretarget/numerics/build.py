"""Build the library of compiled functions: numba compiles them, llvmlite makes an object of each kind of processor's.

    python -m distretarget.numerics.build FOLDER [PLATFORM]

It needs numba, and to link the system's `cc`, or for another platform the package ziglang. `hatch_build.py` runs it.
"""

from __future__ import annotations

import importlib
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any, NamedTuple, get_args, get_origin, get_type_hints

import numpy as np

from distretarget.numerics import compiled
from distretarget.numerics.compiled import LIBRARY, MANIFEST, PACKAGE, WRITTEN, Kind, digest, symbol_of, this_platform


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
FOREIGN = {"cos", "sin", "sqrt"}  # functions of the system that the library may call, beside those that LLVM adds
CONTIGUOUS, ALIGNED, WRITEABLE = 0x1, 0x100, 0x400  # numpy's flags of arrays
# What follows the head of numpy's arrays: data, number of axes, lengths, strides; see PyArrayObject_fields.
ARRAY = "%array = type { ptr, i32, ptr, ptr }"


def build(folder: Path, platform: str) -> str:
    """Write the library for a platform and its manifest to a folder; return a line about it.

    Raises:
        SystemExit: a function does not compile, or nothing here can link the library.
    """
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
        _link(objects, library, None if is_own else target.zig)
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
    """Link by the system's compiler, or for another platform, or without one, by zig."""
    if zig is None and shutil.which("cc"):
        command = ["cc"]
    elif find_spec("ziglang"):
        command = [sys.executable, "-m", "ziglang", "cc", *(["-target", zig] if zig else [])]
    else:
        raise SystemExit("distretarget: to link its functions, install a C compiler (cc) or the package ziglang")
    caches = {f"ZIG_{kind}_CACHE_DIR": str(library.parent) for kind in ("GLOBAL", "LOCAL")}
    subprocess.run([*command, "-shared", "-o", library, *objects, "-lm"], check=True, env=os.environ | caches)


def write_object(path: Path, triple: str, cpu: str) -> None:
    """Write an object with all functions, as numba compiles them, for a kind of processor; and their types as JSON."""
    import llvmlite.binding as llvm

    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    machine = llvm.Target.from_triple(triple).create_target_machine(cpu, FEATURES.get(cpu, ""), 3, "pic", "default")
    prefix = f"{cpu.replace('-', '_')}_"
    head = f'target triple = "{triple}"\ntarget datalayout = "{machine.target_data}"\n'
    whole, types = llvm.parse_assembly(f"{head}@{prefix}head = dllexport global i64 0"), {}
    for function, name, text in _compile():
        leaves = [leaf for hint in _hints(function) for leaf in _leaves(hint)]
        types[symbol_of(function)] = [_kept(*leaf) for leaf in leaves]
        entry = _entry(prefix, symbol_of(function), name, leaves)
        text = re.sub(r"^target .*$", "", text, flags=re.MULTILINE)
        whole.link_in(llvm.parse_assembly(f"{head}{text}\n{ARRAY}\n@{prefix}head = external global i64{entry}"))
    for each in (*whole.functions, *whole.global_variables):
        if not each.is_declaration and each.storage_class != llvm.StorageClass.dllexport:
            each.linkage = "internal"
    passes = llvm.create_new_module_pass_manager()
    passes.add_global_dead_code_eliminate_pass()
    passes.add_strip_dead_prototype_pass()
    passes.run(whole, llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options()))
    foreign = {each.name for each in whole.functions if each.is_declaration and not each.name.startswith("llvm.")}
    if foreign - FOREIGN:
        raise SystemExit(f"distretarget: not every system has {', '.join(sorted(foreign - FOREIGN))}")
    path.write_bytes(machine.emit_object(whole))
    path.with_suffix(".json").write_text(json.dumps(types))


def _compile() -> Iterator[tuple[Callable[..., Any], str, str]]:
    """Yield each function that Python calls, its name in LLVM's language, and its text with all that it calls."""
    from numba.core import compiler, compiler_lock, cpu_options, registry

    for path in _sources():
        importlib.import_module(".".join(("distretarget", *path.relative_to(PACKAGE).with_suffix("").parts)))
    introduce_parts()
    contexts = registry.cpu_target.typing_context, registry.cpu_target.target_context
    contexts[1].refresh()
    for call, fastmath in compiled.functions:
        flags, function = compiler.Flags(), call.__wrapped__
        flags.error_model, flags.fastmath = "numpy", cpu_options.FastMathOptions(fastmath)
        flags.no_compile = flags.no_cpython_wrapper = flags.no_cfunc_wrapper = True
        types = [_numba_type(hint, WRITTEN in get_args(hint)) for hint in _hints(function)]
        made = compiler.compile_extra(*contexts, function, types, None, flags, {})
        with compiler_lock.global_compiler_lock:
            made.library.finalize()
        yield function, made.fndesc.mangled_name, made.library.get_llvm_str()


def introduce_parts() -> None:
    """Make known to numba what compiled functions may call; no array is allocated, so no references are counted."""
    from numba.extending import register_jitable

    while compiled.parts:
        part, fastmath = compiled.parts.pop()
        register_jitable(fastmath=fastmath, forceinline=True, error_model="numpy", _nrt=False)(part)


def _hints(function: Callable[..., Any]) -> list[Any]:
    hints = get_type_hints(function, include_extras=True)
    return [hint for name, hint in hints.items() if name != "return"]


def _numba_type(hint: Any, written: bool = True) -> Any:
    """What numba calls a type; arrays in tuples may be written to."""
    from numba import from_dtype
    from numba.core import types

    if get_origin(hint) is Annotated:
        kind = get_args(hint)[1]
        return types.Array(from_dtype(np.dtype(kind.dtype)), kind.axes, "C", readonly=not written)
    if hasattr(hint, "_fields"):
        fields = get_type_hints(hint, include_extras=True).values()
        return types.BaseTuple.from_types([_numba_type(field) for field in fields], hint)
    return {int: types.int64, float: types.float64, bool: types.boolean}[hint]


def _leaves(hint: Any) -> Iterator[tuple[Any, bool]]:
    """Yield a `Kind` or a class of numbers, and whether it is written, for each value in a type."""
    if get_origin(hint) is Annotated:
        yield get_args(hint)[1], WRITTEN in get_args(hint)
    elif hasattr(hint, "_fields"):
        for field in get_type_hints(hint, include_extras=True).values():
            yield from _leaves(field)
    else:
        yield hint, False


def _kept(kind: Any, written: bool) -> tuple[str, int, int] | None:
    """What the manifest says of a value: the dtype, the axes and the flags of an array."""
    flags = CONTIGUOUS | ALIGNED | (WRITEABLE if written else 0)
    return (kind.dtype, kind.axes, flags) if isinstance(kind, Kind) else None


def _entry(prefix: str, symbol: str, name: str, leaves: list[tuple[Any, bool]]) -> str:
    """The function of the library, in LLVM's language: it takes a list of addresses of arrays and floats, and calls the
    function `name` with what is there, an array as numba does: two owners, number and size of items, data,
    lengths, strides.
    """
    lines, given = [f"%head = load i64, ptr @{prefix}head", "%result = alloca i64", "%raised = alloca ptr"], []
    for n, (kind, _) in enumerate(leaves):
        lines += [f"%at{n} = getelementptr ptr, ptr %values, i64 {n}", f"%object{n} = load ptr, ptr %at{n}"]
        lines += [f"%body{n} = getelementptr i8, ptr %object{n}, i64 %head"]
        if not isinstance(kind, Kind):
            given.append(f"double %v{n}")
            lines += [f"%v{n} = load double, ptr %body{n}"]
            if kind is not float:
                given[-1] = f"i64 %i{n}" if kind is int else f"i1 %i{n}"
                lines += [f"%i{n} = {'fptosi' if kind is int else 'fptoui'} double %v{n} to {given[-1].split()[0]}"]
            continue
        lines += [f"%data{n} = load ptr, ptr %body{n}", f"%count{n}_0 = add i64 1, 0"]
        for field, what in ((2, "length"), (3, "stride")):
            lines += [f"%p{n}_{what} = getelementptr %array, ptr %body{n}, i32 0, i32 {field}"]
            lines += [f"%{what}{n} = load ptr, ptr %p{n}_{what}"]
            for axis in range(kind.axes):
                lines += [f"%q{n}_{what}_{axis} = getelementptr i64, ptr %{what}{n}, i64 {axis}"]
                lines += [f"%{what}{n}_{axis} = load i64, ptr %q{n}_{what}_{axis}"]
        for axis in range(kind.axes):
            lines += [f"%count{n}_{axis + 1} = mul i64 %count{n}_{axis}, %length{n}_{axis}"]
        given += ["ptr null", "ptr null", f"i64 %count{n}_{kind.axes}", f"i64 {np.dtype(kind.dtype).itemsize}"]
        given += [
            f"ptr %data{n}",
            *(f"i64 %{what}{n}_{axis}" for what in ("length", "stride") for axis in range(kind.axes)),
        ]
    lines += [f'%status = call i32 @"{name}"({", ".join(["ptr %result", "ptr %raised", *given])})']
    body = "\n".join([*lines, "%value = load i64, ptr %result", "ret i64 %value"])
    return f"\ndefine dllexport i64 @{prefix}{symbol}(ptr %values) {{\n{body}\n}}\n"


if __name__ == "__main__":
    if sys.argv[1] == "--object":
        write_object(Path(sys.argv[2]), *sys.argv[3:])
    else:
        print(build(Path(sys.argv[1]), *(sys.argv[2:] or [this_platform()])))

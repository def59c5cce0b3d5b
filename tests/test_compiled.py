"""Compiled functions do what their Python does, refuse other types, and a library that does not fit says so."""

import ast
import copy
import inspect
import json
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from operator import itemgetter

import numpy as np
import pytest
from bodies import HERO, SAMPLES
from characters import Bones, box_mesh, character
from program import run

from distretarget import Options, load_target, read_bvh, retarget
from distretarget.errors import LibraryError
from distretarget.numerics import build, compiled
from distretarget.numerics.joint_paths import _write_steps, steps_along

MOST_CALLS = 2  # of a function that are compared


@pytest.fixture(scope="module")
def calls(tmp_path_factory):
    """The arguments of the smallest calls of compiled functions, by function, as clips on a few bodies make them."""
    noted, checked = {}, compiled._checked

    def note(function, arguments, kinds):
        assert not overlapping(function, arguments), function.__qualname__
        some, size = noted.setdefault(function, []), sum(each.size for each in arrays_of(arguments))
        if len(some) < MOST_CALLS or size < some[-1][0]:
            some[MOST_CALLS - 1 :] = [(size, copy.deepcopy(arguments))]
            some.sort(key=itemgetter(0))
        return checked(function, arguments, kinds)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(compiled, "_checked", note)
        clip, squat = read_bvh(SAMPLES / "clap.bvh")[100:104], read_bvh(SAMPLES / "squat.bvh")[:4]
        bones = Bones.of(clip.skeleton)
        boxes = character(bones, meshes=[box_mesh(bones)]).write(tmp_path_factory.mktemp("boxes") / "boxes.glb")
        for motion, target, objective in (
            (clip, HERO, "contact"),
            (clip, boxes, "contact"),
            (squat, SAMPLES / "child.json", "contact"),
            (squat, SAMPLES / "child.json", "paper"),
        ):
            assert retarget(motion, load_target(target), Options(objective=objective)).metrics
    return {function: [arguments for _, arguments in some] for function, some in noted.items()}


def arrays_of(arguments):
    """All arrays among arguments, also in tuples."""
    arrays = []
    compiled._collect(arguments, arrays)
    return [each for each in arrays if isinstance(each, np.ndarray)]


def outputs(function, arguments):
    """The arrays that a function writes to, by name."""
    named = zip(inspect.signature(function).parameters.values(), arguments, strict=True)
    return {parameter.name: value for parameter, value in named if parameter.annotation.startswith("Out[")}


def written(function, arguments):
    """What a function writes, but for scratch and the numbers of iterations, which rounding changes."""
    out = outputs(function, arguments)
    return {name: value for name, value in out.items() if name not in {"log", "scratch", "gradient"}}


def overlapping(function, arguments):
    """Whether an array that a function writes to overlaps another one."""
    arrays = arrays_of(arguments)
    return any(
        sum(np.may_share_memory(one, other) for other in arrays) > 1 for one in outputs(function, arguments).values()
    )


class FromTheFront(np.ndarray):
    """An array without negative indices, with which compiled functions would leave it."""

    def __getitem__(self, index):
        return super().__getitem__(not_negative(index))

    def __setitem__(self, index, value):
        super().__setitem__(not_negative(index), value)


def not_negative(index):
    numbers = index if isinstance(index, tuple) else (index,)
    assert not any(isinstance(each, int | np.integer) and each < 0 for each in numbers), index
    return index


def from_the_front(argument):
    """An argument with arrays, also in its tuples, that refuse negative indices."""
    if isinstance(argument, tuple):
        return type(argument)(*map(from_the_front, argument))
    return argument.view(FromTheFront) if isinstance(argument, np.ndarray) else argument


def test_compiled_functions_do_what_their_python_does(calls):
    compared = set()
    for call, _ in compiled.functions:
        for arguments in calls.get(call.__wrapped__, ()):
            own, python = copy.deepcopy(arguments), [*map(from_the_front, copy.deepcopy(arguments))]
            returned = call(*own)
            with np.errstate(all="ignore"):
                assert call.__wrapped__(*python) == returned
            expected = written(call.__wrapped__, python)
            for name, value in written(call.__wrapped__, own).items():
                np.testing.assert_allclose(value, expected[name], 1e-6, 1e-6, err_msg=f"{call.__qualname__}: {name}")
            compared.add(call.__qualname__)
    assert len(compared) > 0.8 * len(compiled.functions)


def test_the_library_has_all_functions():
    library = compiled.loaded()
    for call, _ in compiled.functions:
        assert library.entry(call.__wrapped__)


@pytest.mark.parametrize(
    ("number", "value", "found"),
    [
        (0, np.zeros((3, 2, 3), np.float32), "float32"),
        (0, np.zeros((3, 6)), r"\(3, 6\)"),
        (0, np.zeros((3, 3, 2)).transpose(0, 2, 1), "flags"),
        (0, np.zeros((3, 2, 3), ">f8"), ">f8"),
        (0, [[[0.0]]], r"\[\[\["),
        (1, np.zeros(2), "float64"),
        (3, np.broadcast_to(0.0, (2, 2)), "flags"),
    ],
)
def test_arguments_of_other_types_are_refused(number, value, found):
    arguments = [np.zeros((3, 2, 3)), np.arange(2), 1, np.zeros((2, 2))]
    assert _write_steps(*arguments) is None
    arguments[number] = value
    with pytest.raises(TypeError, match=f"_write_steps: array {number} is .*{found}.*; expected"):
        _write_steps(*arguments)


def test_a_call_with_too_few_arguments_is_refused():
    with pytest.raises(TypeError, match="_write_steps takes 4 arrays and numbers, not 2"):
        _write_steps(np.zeros((3, 2, 3)), np.arange(2))


def test_threads_get_the_same():
    paths = np.random.default_rng(0).normal(size=(2000, 20, 3))
    with ThreadPoolExecutor(8) as pool:
        results = list(pool.map(lambda _: steps_along(paths), range(32)))
    assert all(np.array_equal(result, results[0]) for result in results)


@pytest.fixture
def library(tmp_path, monkeypatch):
    """A copy of the library and its manifest, which are the ones to load."""
    for name in ("LIBRARY", "MANIFEST"):
        path = getattr(compiled, name)
        (tmp_path / path.name).write_bytes(path.read_bytes())
        monkeypatch.setattr(compiled, name, tmp_path / path.name)
    return tmp_path


def refusal():
    with pytest.raises(LibraryError) as refused:
        compiled.loaded.__wrapped__()
    line = str(refused.value)
    assert "\n" not in line
    assert line.startswith(str(compiled.LIBRARY))
    return line


def changed(**values):
    known = json.loads(compiled.MANIFEST.read_text()) | values
    compiled.MANIFEST.write_text(json.dumps(known))


def test_a_library_that_fits_is_loaded(library):
    assert compiled.loaded.__wrapped__().code._name.startswith(str(library))


def with_content(content):
    """Make this the content of the library, and the manifest's digest that of it."""
    compiled.LIBRARY.write_bytes(content)
    changed(digest=compiled.digest(content))


NOT_FITTING = {
    "no library": (lambda: compiled.LIBRARY.unlink(), "is missing; the compiled functions come with: pip install "),
    "no manifest": (lambda: compiled.MANIFEST.unlink(), "is missing; the compiled functions come with: pip install "),
    "another content": (
        lambda: compiled.LIBRARY.write_bytes(compiled.LIBRARY.read_bytes()[:-1] + b"?"),
        "is damaged; ",
    ),
    "a damaged manifest": (lambda: compiled.MANIFEST.write_text("{"), "cannot be loaded here ("),
    "another machine": (
        lambda: changed(platform="plan9-mips"),
        f"for plan9-mips, and this is {compiled.this_platform()}; ",
    ),
    "what the system cannot load": (lambda: with_content(b"no library"), "cannot be loaded here ("),
    "an older one": (
        lambda: changed(sources=json.loads(compiled.MANIFEST.read_text())["sources"] | {"ik/spg.py": "another"}),
        f"is older than {compiled.PACKAGE / 'ik' / 'spg.py'}; ",
    ),
}


@pytest.mark.usefixtures("library")
@pytest.mark.parametrize(("change", "said"), NOT_FITTING.values(), ids=NOT_FITTING)
def test_a_library_that_does_not_fit_is_not_run_and_says_why(change, said):
    change()
    assert said in refusal()


@pytest.mark.usefixtures("library")
def test_sources_may_be_absent():
    changed(sources={"ik/gone.py": "another"})
    assert compiled.loaded.__wrapped__()


def test_a_function_that_was_never_built_is_said():
    def unknown() -> None:
        """Do nothing."""

    with pytest.raises(LibraryError, match=r"has no code of test_compiled.*unknown; .* pip install"):
        compiled.compiled()(unknown)()
    compiled.functions.pop()


def test_the_command_line_says_it_in_one_line(monkeypatch, tmp_path):
    def refuse():
        raise LibraryError("kernels.so", "is damaged", "pip")

    monkeypatch.setattr(compiled, "loaded", refuse)
    monkeypatch.setattr("distretarget.numerics.kinematics._positions", compiled.compiled()(_positions))
    done = run(SAMPLES / "squat.bvh", SAMPLES / "child.json", "-o", tmp_path / "out.bvh")
    compiled.functions.pop()
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.endswith("kernels.so: is damaged; the compiled functions come with: pip\n")
    assert not list(tmp_path.iterdir())


def _positions(*_) -> None:
    """Stand for a function that is called by all."""


PLAIN = """
import numpy, sys
from distretarget import load_target, read_bvh, retarget
from distretarget.numerics.compiled import loaded
print(loaded().cpu)
print(*retarget(read_bvh(sys.argv[1])[:5], load_target(sys.argv[2])).motion.rotations.ravel().tolist())
"""


@pytest.mark.skipif(
    "x86-64-v3" not in json.loads(compiled.MANIFEST.read_text())["cpus"], reason="one kind of processor"
)
def test_a_plain_processor_gets_code_that_it_can_run():
    found = np.show_config(mode="dicts")["SIMD Extensions"].get("found", ())
    results = []
    for disabled in ("", " ".join(found)):
        environment = os.environ | {"NPY_DISABLE_CPU_FEATURES": disabled}
        command = [sys.executable, "-c", PLAIN, SAMPLES / "squat.bvh", SAMPLES / "child.json"]
        cpu, values = subprocess.run(command, env=environment, capture_output=True, text=True).stdout.splitlines()
        assert cpu == "x86-64" or not disabled
        results.append(np.array(values.split(), float))
    np.testing.assert_allclose(*results, atol=1e-6)


WITHOUT = """
import importlib, sys
class Nothing:
    def find_spec(name, path, target=None):
        if name.partition(".")[0] in {"scipy", "click", "tqdm", "bvhio"}:
            raise ImportError(name)
sys.meta_path.insert(0, Nothing)
for module in sys.argv[1:]:
    importlib.import_module(module)
"""


MODULES = {
    ".".join(("distretarget", *path.relative_to(build.PACKAGE).with_suffix("").parts)): path
    for path in build._sources()
}


def test_modules_with_compiled_functions_import_numpy_alone():
    done = subprocess.run([sys.executable, "-c", WITHOUT, *MODULES], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("module", MODULES)
def test_compiled_functions_use_what_changes_with_their_sources(module):
    """A constant of another module would change without the library being out of date."""
    tree = ast.parse(MODULES[module].read_text())
    foreign = {
        alias.name
        for node in tree.body
        if isinstance(node, ast.ImportFrom) and node.module.startswith("distretarget") and node.module not in MODULES
        for alias in node.names
    }
    for function in ast.walk(tree):
        if isinstance(function, ast.FunctionDef) and function.decorator_list:
            used = {
                node.id for statement in function.body for node in ast.walk(statement) if isinstance(node, ast.Name)
            }
            assert not used & foreign, function.name

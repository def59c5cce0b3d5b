"""The layout: imports point downwards, public names are documented, the front page tells the truth."""

import ast
import functools
import importlib
import inspect
import re

import pytest
from bodies import ROOT

import distretarget

PACKAGE = ROOT / "distretarget"

# The rooms and single modules of the package from the top down; each imports only from those below it.
FLOORS = (
    "__main__",
    "cli",
    "__init__",
    "public",
    "studio",
    "batch",
    "report",
    "scene",
    "pipeline",
    "io",
    "measure objectives",
    "ik",
    "baseline",
    "matching character",
    "body",
    "target contact_entries",
    "skin",
    "distances",
    "motion",
    "skeleton",
    "stick_figures",
    "rig",
    "numerics",
    "checks",
    "errors",
)


def floor_of(room):
    return next(floor for floor, rooms in enumerate(FLOORS) if room in rooms.split())


def module_of(path):
    return path.relative_to(PACKAGE).with_suffix("").parts[0]


@functools.cache
def tree_of(path):
    return ast.parse(path.read_text("utf-8"))


def imports_of(path):
    for node in ast.walk(tree_of(path)):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == "distretarget":
            yield ([*node.module.split("."), "__init__"])[1]


FILES = sorted(PACKAGE.rglob("*.py"))


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_point_downwards_only_the_command_line_prints_and_only_the_bridge_knows_bvhio(path):
    room = module_of(path)
    for imported in imports_of(path):
        inside = room == imported and path.parent != PACKAGE
        assert inside or floor_of(imported) > floor_of(room), f"{room} imports {imported}"
    imported = {alias.name for node in ast.walk(tree_of(path)) if isinstance(node, ast.Import) for alias in node.names}
    imported |= {node.module for node in ast.walk(tree_of(path)) if isinstance(node, ast.ImportFrom)}
    if module_of(path) != "cli" and path.name != "build.py":  # which is a command of its own
        assert not imported & {"click", "tqdm"}
        assert "print(" not in path.read_text()
    if path.name != "interop.py":
        assert "bvhio" not in imported


# What `measure/` and `objectives/` may both import: types, names of parts, texts; and Eq. (2), whose value is `stress`.
PLAIN = {
    "SkinnedMesh",
    "Body",
    "Limb",
    "Leg",
    "Legs",
    "Sole",
    "Regions",
    "Matching",
    "DroppedContact",
    "Motion",
    "Skeleton",
    "Capsules",
    "SIDES",
    "SEGMENTS",
    "SettingsError",
    "counted",
    "distance_problem",
    "rig_cached",
}
# Modules that tell what rests, touches or is the floor: a judge takes types from them alone.
JUDGEMENT = ("body.resting", "body.limbs", "body.soles", "matching.undersides", "skin.limbs", "skin.displacement")


def names_imported_by(room, *but):
    """The names that the files of a room, `but` some, import from the package, each as (module, name)."""
    for path in {*(PACKAGE / room).rglob("*.py")} - {PACKAGE / room / name for name in but}:
        for node in ast.walk(tree_of(path)):
            if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == "distretarget":
                yield from ((node.module.removeprefix("distretarget."), alias.name) for alias in node.names)


def test_what_judges_shares_nothing_but_plain_types_with_what_is_judged():
    measure, objectives = ({*names_imported_by(room)} for room in ("measure", "objectives"))
    shared = {(module, name) for module, name in measure & objectives if not module.startswith("numerics")}
    assert {name for _, name in shared} <= PLAIN, shared
    of_results = names_imported_by("measure", "clip_faults.py")  # which looks at sources before they are solved
    judging = {(module, name) for module, name in of_results if module in JUDGEMENT}
    assert {name for _, name in judging} <= PLAIN, judging
    assert not [module for module, _ in measure if module.startswith("objectives")]
    assert not [module for module, _ in objectives if module.startswith("measure")]


def test_the_table_of_rooms_is_in_the_order_of_the_floors():
    text = (ROOT / "ARCHITECTURE.md").read_text()
    rooms = re.findall(r"`(\w+)(?:/|\.py)`", "".join(re.findall(r"^\| (`[^|]*) \|", text, re.M)))
    named = {room for room in " ".join(FLOORS).split() if not room.startswith("__")}
    assert set(rooms) == named
    floors = [floor_of(room) for room in rooms]
    assert floors == sorted(floors)


def test_no_name_hides_a_module():
    packages = [path.parent for path in FILES if path.name == "__init__.py"]
    for package in packages:
        face = importlib.import_module(".".join(package.relative_to(ROOT).parts))
        modules = {path.stem for path in package.iterdir() if path.suffix == ".py" or (path / "__init__.py").exists()}
        hidden = [name for name in modules & set(dir(face)) if not inspect.ismodule(getattr(face, name))]
        assert not hidden, f"{package.name}: {hidden}"


@pytest.mark.parametrize("name", distretarget.__all__)
def test_public_names_exist_and_are_documented(name):
    value = getattr(distretarget, name)
    assert inspect.getdoc(value)
    if inspect.isclass(value):
        for member, own in vars(value).items():
            if not member.startswith("_") and (callable(own) or isinstance(own, property | functools.cached_property)):
                assert inspect.getdoc(own), f"{name}.{member}"


def test_every_public_function_of_the_package_is_documented():
    for path in FILES:
        for node in tree_of(path).body:
            if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
                assert ast.get_docstring(node), f"{path.name}: {node.name}"
        assert ast.get_docstring(tree_of(path)), path.name


def set_ups_of_the_front_page():
    text = (ROOT / "README.md").read_text()
    lines = [line.strip() for block in re.findall(r"```sh\n(.*?)```", text, re.S) for line in block.splitlines()]
    return [line for line in lines if "venv .venv" in line]


def test_two_commands_do_all_the_set_up_and_ci_runs_the_second():
    commands = set_ups_of_the_front_page()
    assert len(commands) == 2
    assert "distretarget sample_bvh/" in commands[0]
    assert "pytest" in commands[1]
    assert commands[1] in (ROOT / ".ci" / "run").read_text().splitlines()


def test_the_extension_for_blender_finds_in_the_package_what_it_imports():
    files = [*(ROOT / "blender").glob("*.py"), ROOT / "tests" / "in_blender.py"]
    nodes = [node for path in files for node in ast.walk(tree_of(path))]
    taken = [
        (node.module, alias.name)
        for node in nodes
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == "distretarget"
        for alias in node.names
    ]
    assert len(taken) > 20
    assert not [(module, name) for module, name in taken if not hasattr(importlib.import_module(module), name)]

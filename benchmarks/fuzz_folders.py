"""Folders of generated files for one run of the program: scenes, contact files, pipes, devices, characters."""

from __future__ import annotations

import contextlib
import json
import os
import sys
import tempfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from fuzz_outcomes import REFUSED, RIGHT, NotReadBackError, no_line
from hypothesis import strategies as st
from mutated_gltf import mutated

from distretarget import DistretargetError, read_motion
from distretarget.io.files import is_folder
from distretarget.io.input_file import load_file
from distretarget.io.reading import animations_in

sys.path.append(str(Path(__file__).resolve().parents[1] / "tests"))
import strategies as made
from program import run

TOO_LONG = "frames/s that is too much"  # of a .vrma whose frames are 1000 s apart, which the reader refuses
FOLDER, PIPE, LINK, CHARACTER = "@folder", "@pipe", "@link:", "@character:"  # files that are no texts
SKINS = ("auto", "average", "none")
SPECIAL = (FOLDER, PIPE, f"{LINK}/dev/zero", f"{LINK}none", f"{LINK}.", f"{LINK}../../../etc/passwd", "")


class Folder(NamedTuple):
    """Files, and the arguments of the program."""

    files: dict[str, str]  # by name: a text, or one of FOLDER, PIPE, LINK and CHARACTER
    arguments: list[str]


def _mostly(first: st.SearchStrategy[Any], *others: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    """Nearly always the first of some strategies, since a folder has many draws and few should be odd."""
    return st.integers(0, 999).flatmap(lambda number: st.one_of(*others) if number % 16 == 7 else first)


PARTS = ("left hand", "right hand", "hips", "head", "left foot", "right foot", "right forearm")
JOINTS = ("Hips", "LeftWrist", "RightWrist", "Head", "LeftAnkle", "Chest")
parts = _mostly(st.sampled_from(PARTS), st.sampled_from(JOINTS), made.names)
numbers = _mostly(
    st.sampled_from((0, 0.5, 1)), st.sampled_from((-1, 100, 1e9, 1e12, 1e-12)), st.floats(0, 10, width=32)
)
starts = _mostly(st.sampled_from((0, 0.0, 0.01)), numbers)
spans = _mostly(st.tuples(st.just(0), st.integers(0, 1)).map(list), st.lists(numbers, max_size=3))
places = _mostly(st.lists(numbers, min_size=3, max_size=3), st.lists(numbers, max_size=4))
pairs = _mostly(st.lists(parts, min_size=2, max_size=2, unique=True), st.lists(parts, max_size=3))
turned = st.sampled_from(("head", "left hand", "right foot"))
common = {"frames": spans, "found": st.just("here")}
entries = st.one_of(
    st.fixed_dictionaries({"between": pairs, "keep": st.just(False)}, optional=common),
    st.fixed_dictionaries(
        {"between": pairs, "gap": numbers | st.just("source")}, optional=common | {"firmness": numbers}
    ),
    st.fixed_dictionaries({"plant": parts, "on": st.sampled_from(("floor", "where it is")) | places}, optional=common),
    st.fixed_dictionaries({"distance": pairs, "value": numbers}, optional=common | {"priority": numbers}),
    st.fixed_dictionaries({"look": turned, "like": places | st.just("source")}, optional=common),
    st.fixed_dictionaries(
        {}, optional=common | {"between": pairs, "plant": parts, "keep": st.booleans(), "seconds": spans}
    ),
)
contact_files = st.lists(_mostly(entries, made.strange_values), max_size=2).map(
    lambda contacts: json.dumps({"format": "distretarget-contacts", "version": 1, "contacts": contacts})
)
characters = st.integers(0, 10**6).map(lambda seed: f"{CHARACTER}{seed}")
clips = _mostly(made.sample_clips() | made.changed_clips(), made.random_clips(), made.broken(made.clips))
bodies = _mostly(
    made.sample_targets, made.skeleton_files(), made.sample_clips(), made.broken_json(made.skeleton_files())
)
objects = st.lists(
    _mostly(
        st.sampled_from(("v 0 0 0", "v 1 0 0", "v 0 1 0", "v 0 50 90", "f 1 2 3")),
        st.sampled_from(("v 0 0 1e12", "v 1e308 0 0", "f -1 -2 -3/1", "v 1_0 0 0", "f 1 1 1 1", "v 1e-300 0 0")),
    ),
    max_size=8,
).map(lambda lines: "\n".join(["v 5 5 5", "v 9 0 3", "v 0 7 1", *lines]))


flags = made.often(made.options, made.strange_options).map(
    lambda options: [f"--{key.replace('_', '-')}={value}" for key, value in options.items()]
)
maps = _mostly(made.map_files, made.broken_json(made.map_files))


def _spoilt(draw: st.DrawFn, files: dict[str, str]) -> dict[str, str]:
    """The files, at times with one of them replaced by a special file or an empty one."""
    if draw(st.integers(0, 999)) % 8 == 5:
        files[draw(st.sampled_from(sorted(files)))] = draw(st.sampled_from(SPECIAL))
    return files


@st.composite
def scenes(draw: st.DrawFn) -> Folder:
    """A scene file with performers and props, or equivalent options."""
    files, performers = dict[str, str](), []
    for number in range(draw(st.integers(1, 3))):
        performer: dict[str, Any] = {"source": f"p{number}.bvh", "target": f"body{number}.json"}
        files |= {performer["source"]: draw(clips), performer["target"]: draw(bodies)}
        skin = _mostly(st.sampled_from(SKINS), st.just("p0.bvh"))
        name = _mostly(st.just(f"one{number}"), made.names)
        more = {"start": starts, "skin": skin, "name": name}
        performer |= draw(st.fixed_dictionaries({}, optional=more))
        if not draw(st.integers(0, 3)):
            performer["contacts"] = "contacts.json"
            files["contacts.json"] = draw(contact_files)
        performers.append(performer)
    props = []
    who = st.sampled_from([each.get("name", f"p{number}") for number, each in enumerate(performers)])
    who = _mostly(who, st.just("nobody"))
    grips = st.fixed_dictionaries({"performer": who, "joint": _mostly(st.sampled_from(JOINTS), made.names)})
    for number in range(draw(st.sampled_from((0, 0, 1, 2)))):
        prop: dict[str, Any] = {"name": draw(_mostly(st.just(f"prop{number}"), made.names))}
        if draw(st.integers(0, 3)):
            prop["file"] = f"prop{number}{draw(st.sampled_from(('.bvh', '.obj')))}"
            files[prop["file"]] = draw(clips if prop["file"].endswith("bvh") else objects)
        else:
            prop["part_of"] = draw(grips)
        scale = _mostly(st.sampled_from(("world", 1.0, 2.5)) | who, st.sampled_from((1e-12, 1e12)))
        more = {"scale": scale, "held_by": st.lists(grips, max_size=2), "start": starts}
        prop |= draw(st.fixed_dictionaries({}, optional=more))
        props.append(prop)
    kinds = {"supports": ("hold", "feet", "free"), "environment": ("body", "scaled"), "skin": SKINS}
    chosen = {key: st.sampled_from(values) for key, values in kinds.items()}
    options = st.fixed_dictionaries({}, optional={"world_scale": st.sampled_from((0.5, 1.0, 2)) | numbers, **chosen})
    same = {"cut": True, "resample": True} if draw(st.integers(0, 5)) else {}
    scene = {"format": "distretarget-scene", "version": 1, "performers": performers, "props": props} | same
    text = st.just(json.dumps(scene | draw(options)))
    files["scene.json"] = draw(_mostly(text, made.broken_json(text)))
    named = ["scene", *(each["source"] for each in performers)]
    targets = [word for each in performers for word in ("-t", each["target"])]
    own = [*named, *targets, "--cut", "--resample"]
    arguments = draw(st.sampled_from((["scene", "scene.json"], ["scene", "scene.json"], ["scene", "."], own)))
    report = draw(st.sampled_from(([], [], ["--report", "out.html"])))
    return Folder(_spoilt(draw, files), [*arguments, "-o", "out", *report])


@st.composite
def contacts(draw: st.DrawFn) -> Folder:
    """A clip with a contact file, to retarget or to list."""
    files = {
        "in.bvh": draw(clips),
        "body.json": draw(bodies),
        "c.json": draw(_mostly(contact_files, made.broken_json(contact_files))),
    }
    line = "retarget in.bvh body.json -o out.bvh --contacts c.json"
    lines = (line, line, f"{line} --objective paper", "contacts in.bvh body.json -o out.json")
    line = draw(st.sampled_from(lines))
    return Folder(_spoilt(draw, files), line.split())


@st.composite
def commands(draw: st.DrawFn) -> Folder:
    """Any command on files of any kind, with a pipe, a device, a folder or a character among them."""
    suffix = draw(st.sampled_from((".bvh", ".glb", ".json", ".npz", ".vrma")))
    a, b = f"a{draw(st.sampled_from(('.bvh', '.bvh', '.glb', '.npz')))}", f"b{suffix}"
    contents = {".bvh": clips, ".json": bodies, ".glb": characters, ".vrma": characters, ".npz": characters | clips}
    files = {a: draw(contents[Path(a).suffix]), b: draw(contents[suffix]), "map.json": draw(maps)}
    if not draw(st.integers(0, 9)):
        files["out/results.sqlite"] = draw(st.sampled_from(("", "SQLite format 3\0", "a text")))
    out = draw(st.sampled_from(("out.bvh", "out.bvh", "out.glb", "out.vrma", "out.npz", "-", a, "none/out.bvh", "out")))
    lines = (
        f"retarget {a} {b} -o {out}",
        f"retarget {a} {b} -o {out} --map map.json",
        f"retarget {a} {b} -o {out} --fps 12 --in-place --report out.html --json out.json",
        f"diff {a} {b} --json out.json",
        f"diff {a} {a} -v",
        f"skeleton show {b}",
        f"skeleton export {b} -o out.json",
        f"skeleton edit {b} --scale 2 -o out.json",
        f"skeleton match {a} {b} -o out.json",
        f"contacts {a} {b}",
        f"view {a} {b} -o out.html",
        f"audit {a} {b} . --table out.csv",
        f"batch {a} . {b} -o out --jobs 1 --dry-run",
        f"batch {a} none.bvh {b} -o out --jobs 1 --format own,npz --report out.html",
    )
    own, line = draw(flags), draw(st.sampled_from(lines))
    return Folder(_spoilt(draw, files), [*line.split(), *(own if line == lines[0] else ())])


def run_in_folder(case: Folder) -> str:
    """Run the program once among these files, in this process, and return the outcome.

    Raises:
        RuntimeError: it printed a traceback, no line that says why, or one that is no line for a user.
        NotReadBackError: what it wrote is not finite or not read back.
    """
    files, arguments = case
    with tempfile.TemporaryDirectory() as name, contextlib.chdir(name):
        for path, content in files.items():
            _make(Path(path), content)
        done = run(*arguments)
        if done.returncode not in (0, 1, 2) or "Traceback" in done.stderr or "Exception ignored" in done.stderr:
            raise RuntimeError(f"status {done.returncode}: {done.stderr[-600:]}")
        if fault := next(filter(None, map(no_line, done.stderr.splitlines())), ""):
            raise RuntimeError(fault)
        if done.returncode and not (done.stderr or done.stdout).strip():
            raise RuntimeError(f"status {done.returncode}, and no line says why")
        _check_written(files)
    return REFUSED if done.returncode else RIGHT


def _make(path: Path, content: str) -> None:
    path.parent.mkdir(exist_ok=True)
    if content == FOLDER:
        path.mkdir()
    elif content == PIPE:
        os.mkfifo(path)
    elif content.startswith(LINK):
        path.symlink_to(content.removeprefix(LINK))
    elif content.startswith(CHARACTER):
        path.write_bytes(mutated(int(content.removeprefix(CHARACTER)))[1])
    else:
        path.write_bytes(content.encode("utf-8", "surrogatepass"))


def _check_written(files: dict[str, str]) -> None:
    """Read all motions that were written, and all JSON; nothing is left half written."""

    def refuse(name: str) -> None:
        raise NotReadBackError(f"{name} in JSON")

    for path in Path().rglob("*"):
        if str(path) in files or path.is_symlink() or is_folder(path) or not path.is_file():
            continue
        if path.name.startswith(".distretarget-"):
            raise NotReadBackError(f"{path} is left")
        if path.suffix in (".bvh", ".glb", ".vrma"):
            try:
                names = animations_in(load_file(path))
                motion = read_motion(path, clip=f"#{len(names)}" if len(names) > 1 else None)
            except DistretargetError as error:
                if TOO_LONG not in str(error):
                    raise NotReadBackError(str(error)) from error
            else:
                if not np.isfinite(motion.positions).all():
                    raise NotReadBackError(f"{path} is not finite")
        elif path.suffix == ".json":
            json.loads(path.read_bytes(), parse_constant=refuse)
        elif path.suffix == ".npz":
            with np.load(path) as arrays:
                for key in arrays:
                    if key != "contact_gaps" and arrays[key].dtype.kind == "f" and not np.isfinite(arrays[key]).all():
                        raise NotReadBackError(f"{path} is not finite")

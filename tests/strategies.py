"""Hypothesis strategies for what users give: clips, skeleton files, maps, records and options, valid and broken."""

from __future__ import annotations

import functools
import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from bvh_texts import format_bvh
from hypothesis import reject
from hypothesis import strategies as st

from distretarget import Motion, Skeleton, SkeletonError
from distretarget.io.bvh import parse_bvh

SAMPLES = Path(__file__).resolve().parents[1] / "sample_bvh"
PARTS = ("Hips", "Spine", "Neck", "Head", "LeftArm", "LeftForeArm", "LeftHand", "LeftUpLeg", "LeftLeg", "LeftFoot")
ROTATIONS = ("Xrotation", "Yrotation", "Zrotation")
POSITIONS = ("Xposition", "Yposition", "Zposition")
CHANNELS = ROTATIONS + POSITIONS
AXES = ("X", "Y", "Z", "-X", "-Y", "-Z")
FRAMES = 4  # most frames of a clip

names = st.one_of(
    st.sampled_from((*PARTS, *(part.replace("Left", "Right") for part in PARTS), "mixamorig:Hips", "a b", "é", "a/b")),
    st.text("abAB_:./ é\udce9", min_size=1, max_size=6).map(str.strip).filter(bool),
)
usual = st.floats(-200, 200, width=32)
extreme = st.sampled_from((0.0, -0.0, 1e-300, 1e-12, 1e-9, 1e-3, 1e3, 1e6, 1e9, 1e12, -1e12))
lengths = st.one_of(usual, usual, usual, st.just(0.0), extreme)
angles = st.one_of(st.floats(-360, 360, width=32), st.sampled_from((0.0, 90.0, -90.0, 180.0, 5000.0, 1e9)))
offsets = st.tuples(lengths, lengths, lengths)
frame_times = st.sampled_from(("0.0333333", "0.0083333", ".01", "1", "1e-5", "1000", "0.5"))
STRANGE_NUMBERS = ["nan", "inf", "-inf", "1e400", "1e13", "5e-324", "1e-9", "-1", "0", "00", "1_0", "0x1", "1,5", "٣"]
KEYWORDS = ["ROOT", "JOINT", "End", "OFFSET", "CHANNELS", "HIERARCHY", "MOTION", "Frames:", "Frame", "Time:"]
MARKS = ["{", "}", "[", "]", ":", '"', "Xrotation", "Wrotation"]
STRANGE_LETTERS = ("", "\0", "\x1a", "\ufeff", "\udce9", "\u2028", "\r", "\t", "a" * 500, "9" * 40)
strange_words = st.sampled_from((*STRANGE_NUMBERS, *KEYWORDS, *MARKS, *STRANGE_LETTERS))
strange_values = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-(10**30), 10**30),
    st.floats(),
    st.sampled_from(("", "x", "Hips", "..", "/etc/passwd", "a" * 300, "\ud800", "\0")),
    st.lists(st.integers(), max_size=2),
    st.dictionaries(st.text(max_size=3), st.integers(), max_size=2),
)


@st.composite
def trees(draw: st.DrawFn) -> list[tuple[str, int]]:
    """Names and parents of joints: a chain, a star, or anything between."""
    count = draw(st.sampled_from((1, 2, 3, 5, 8, 12, 20)))
    reach = draw(st.sampled_from((1, 3, count)))
    parents = [-1, *(draw(st.integers(max(0, j - reach), j - 1)) for j in range(1, count))]
    return [(draw(names), parent) for parent in parents]


@st.composite
def random_clips(draw: st.DrawFn) -> str:
    """A clip of any tree, with any order of channels."""
    tree = draw(trees())
    lines: list[str] = ["HIERARCHY"]
    channels = 0

    def add(joint: int, indent: str) -> None:
        nonlocal channels
        own = list(draw(st.permutations(ROTATIONS)))
        if not joint or draw(st.integers(0, 9)) == 0:
            own = [*POSITIONS, *own]
        own = own[: draw(st.sampled_from((len(own), len(own), len(own), 2, 1, 0)))]
        channels += len(own)
        lines.extend((f"{indent}{'JOINT' if joint else 'ROOT'} {tree[joint][0]}", f"{indent}{{"))
        lines.append(f"{indent}OFFSET {_words(draw(offsets))}")
        lines.append(f"{indent}CHANNELS {len(own)} {' '.join(own)}")
        below = [child for child, (_, parent) in enumerate(tree) if parent == joint]
        for child in below:
            add(child, indent + "\t")
        if not below and draw(st.booleans()):
            lines.extend((f"{indent}End Site", f"{indent}{{", f"{indent}OFFSET {_words(draw(offsets))}", f"{indent}}}"))
        lines.append(f"{indent}}}")

    add(0, "")
    frames = draw(st.integers(0, FRAMES))
    values = st.lists(draw(st.sampled_from((angles, lengths))), min_size=channels, max_size=channels)
    lines += ["MOTION", f"Frames: {frames}", f"Frame Time: {draw(frame_times)}"]
    lines += [_words(draw(values)) for _ in range(frames)]
    return "\n".join(lines) + draw(st.sampled_from(("", "\n", "\n\n", "\r\n")))


@st.composite
def sample_clips(draw: st.DrawFn) -> str:
    """The first frames of a sample clip, with some numbers of the body and of the frames replaced."""
    head, _, motion = _samples()[draw(st.integers(0, len(_samples()) - 1))].partition("MOTION\n")
    words = head.split(" ")
    for place in draw(st.lists(st.sampled_from([i for i, word in enumerate(words) if _is_number(word)]), max_size=4)):
        words[place] = repr(draw(lengths))
    rows = [row.split() for row in motion.splitlines()[2 : 2 + draw(st.integers(1, FRAMES))]]
    for _ in range(draw(st.integers(0, 4))):
        row = draw(st.sampled_from(rows))
        row[draw(st.integers(0, len(row) - 1))] = repr(draw(angles | lengths))
    body = [f"Frames: {len(rows)}", f"Frame Time: {draw(frame_times)}", *map(" ".join, rows)]
    return " ".join(words) + "MOTION\n" + "\n".join(body) + "\n"


@st.composite
def changed_clips(draw: st.DrawFn) -> str:
    """The frames of a sample clip by a body with joints renamed, removed with all below them, or laid along one axis,
    on one another or nearly so.
    """
    motion = _sample_motions()[draw(st.integers(0, len(_samples()) - 1))]
    first = draw(st.integers(0, len(motion) - FRAMES))
    motion = motion[first : first + draw(st.integers(1, FRAMES))]
    body = motion.skeleton
    gone = {below for joint in draw(st.lists(_below_root(body), max_size=2)) for below in body.subtree(joint)}
    kept = np.array([joint for joint in range(len(body)) if joint not in gone])
    offsets, labels = np.array(body.offsets), [name.rpartition(":")[2] for name in body.names]
    for joint in draw(st.lists(_below_root(body), max_size=4)):
        labels[joint] = draw(names)
    axis, size = np.eye(3)[draw(st.integers(0, 2))], draw(st.sampled_from((1.0, -1.0, 0.0, 1e-12)))
    noise = draw(st.sampled_from((0.0, 0.0, 1e-9, 1e-6)))
    for joint in draw(st.lists(_below_root(body), max_size=draw(st.sampled_from((0, 2, 40))))):
        offsets[joint] = np.linalg.norm(offsets[joint]) * (size * axis + noise)
    parents = np.searchsorted(kept, body.parents[kept])
    parents[0] = -1
    try:
        changed = replace(
            body,
            names=tuple(labels[joint] for joint in kept),
            parents=parents,
            offsets=offsets[kept],
            channels=tuple(body.channels[joint] for joint in kept),
            end_sites=body.end_sites[kept],
        )
    except SkeletonError:  # names that cannot be told apart
        reject()
    return format_bvh(Motion(changed, motion.root_positions, motion.rotations[:, kept], motion.frame_time_text))


def _below_root(body: Skeleton) -> st.SearchStrategy[int]:
    return st.integers(1, len(body) - 1)


clips = st.one_of(random_clips(), sample_clips(), changed_clips())


@st.composite
def skeleton_files(draw: st.DrawFn) -> str:
    """A skeleton file, as JSON: a whole skeleton, or changes to the source's."""
    head = {"format": "distretarget-skeleton", "version": 1}
    numbers = st.floats(0.125, 100, width=32) | st.sampled_from((1e-9, 1e9, 1e-12, 1e12))
    if draw(st.booleans()):
        changes = st.dictionaries(names, numbers, max_size=2)
        return json.dumps(head | {"scale": draw(numbers), "lengths": draw(changes), "factors": draw(changes)})
    joints = []
    tree = draw(trees())
    for name, parent in tree:
        joint: dict[str, Any] = {"name": name, "parent": tree[parent][0] if parent >= 0 else None}
        joint["offset"] = draw(offsets)
        if draw(st.booleans()):
            joint["channels"] = draw(st.lists(st.sampled_from(CHANNELS), unique=True))
        joints.append(joint)
    more = draw(st.fixed_dictionaries({}, optional={"up": st.sampled_from(AXES), "map": joint_maps, "name": names}))
    return json.dumps(head | more | {"joints": joints})


joint_maps = st.dictionaries(names, st.none() | names, max_size=4)
sample_targets = st.integers(0, 10**6).map(lambda number: _sample_targets()[number % len(_sample_targets())])
targets = st.one_of(skeleton_files(), sample_targets, sample_targets, clips)
map_files = joint_maps.map(json.dumps)


def often(first: st.SearchStrategy[Any], *others: st.SearchStrategy[Any]) -> st.SearchStrategy[Any]:
    """Mostly the first of some strategies."""
    return st.one_of(*[first] * 4, *others)


scales = st.sampled_from((1.0, 0.5, 2.0, 1e-9, 1e9, 1e-12, 1e12)).map(
    lambda scale: json.dumps({"format": "distretarget-skeleton", "version": 1, "scale": scale})
)
pairs = st.one_of(  # a clip, and a target that it can probably be retargeted to
    clips.flatmap(lambda clip: st.tuples(st.just(clip), st.just(clip) | scales)),
    st.tuples(sample_clips() | changed_clips(), often(sample_targets, sample_clips(), changed_clips())),
    st.tuples(clips, targets),
)


@st.composite
def broken(draw: st.DrawFn, texts: st.SearchStrategy[str]) -> str:
    """A text with parts removed, doubled or replaced by strange words."""
    text = draw(texts)
    for _ in range(draw(st.integers(1, 3))):
        start = draw(st.integers(0, len(text)))
        end = min(len(text), start + draw(st.sampled_from((0, 1, 5, 40, 10**6))))
        between = draw(st.one_of(st.just(""), strange_words, st.just(2 * text[start:end])))
        text = text[:start] + between + text[end:]
    return text


@st.composite
def broken_json(draw: st.DrawFn, texts: st.SearchStrategy[str]) -> str:
    """JSON with a value of another kind somewhere, or broken as a text."""
    text = draw(texts)
    if draw(st.booleans()):
        return draw(broken(st.just(text)))
    lines = text.splitlines()
    place = draw(st.integers(0, len(lines) - 1))
    lines[place] = json.dumps(_with_strange_value(draw, json.loads(lines[place] or "0")))
    return "\n".join(lines) + "\n"


def _with_strange_value(draw: st.DrawFn, value: Any) -> Any:
    """The value with another one somewhere in it."""
    inside = list(value) if isinstance(value, dict) else list(range(len(value))) if isinstance(value, list) else []
    if not inside or draw(st.integers(0, 3)) == 0:
        return draw(strange_values)
    key = draw(st.sampled_from(inside))
    changed = value.copy()
    changed[key] = _with_strange_value(draw, value[key])
    return changed


@st.composite
def records(draw: st.DrawFn) -> str:
    """What the database of a batch says of a clip."""
    name = draw(st.sampled_from(("clip.bvh", "..bvh", "a/b.bvh")))
    outcome = draw(st.sampled_from(({"status": "failed", "error": "no"}, {"status": "done", "output_hash": "x"})))
    return json.dumps({"input": name, "output": name, "frames": 3, "seconds": 0.1} | outcome)


options = st.fixed_dictionaries(
    {},
    optional={
        "objective": st.sampled_from(("contact", "contact", "paper")),
        "supports": st.sampled_from(("hold", "feet", "free")),
        "environment": st.sampled_from(("body", "scaled")),
        "root_scale": st.sampled_from((1.0, 1e-12, 1e-3, 1e6, 1e12)),
        "source_up": st.sampled_from(AXES),
        "target_up": st.sampled_from(AXES),
        "root_offset": st.sampled_from(("replaced", "added")),
        "root_follows": st.sampled_from(("pelvis", "source", "nothing")),
    },
)
strange_options = st.dictionaries(
    st.sampled_from(("objective", "supports", "environment", "root_scale", "source_up", "root_follows", "jobs", "q")),
    st.one_of(
        st.text(max_size=4).filter(lambda text: "\0" not in text), st.sampled_from(("nan", "-1", "1e999", "papr"))
    ),
    max_size=2,
)


def _words(numbers: Any) -> str:
    return " ".join(map(repr, numbers))


def _is_number(word: str) -> bool:
    try:
        return math.isfinite(float(word)) and "." in word
    except ValueError:
        return False


@functools.cache
def _samples() -> list[str]:
    return [path.read_text() for path in sorted(SAMPLES.glob("*.bvh"))]


@functools.cache
def _sample_motions() -> list[Motion]:
    return [parse_bvh(text, "sample.bvh") for text in _samples()]


@functools.cache
def _sample_targets() -> list[str]:
    return [path.read_text() for path in sorted([*SAMPLES.glob("*.json"), *SAMPLES.glob("rigs/*.json")])]

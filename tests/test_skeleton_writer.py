"""Skeleton files as they are written: their text, and round trips."""

import json
from dataclasses import replace

import numpy as np
import pytest
from bodies import tree_of
from hypothesis import assume, given, reject
from hypothesis import strategies as st
from skeleton_files import HIPS, SPINE, assert_same, full, load_json, valid
from table_one import table_one

from distretarget.errors import SkeletonError
from distretarget.io.skeleton_json import ALL_CHANNELS, skeleton_to_json
from distretarget.io.target_file import load_target
from distretarget.skeleton import SMALLEST, Skeleton


def test_table_one_round_trip():
    assert_same(load_json(skeleton_to_json(table_one(), "table one")), table_one())


def test_written_text():
    skeleton = load_json(json.dumps(full(HIPS, SPINE | {"name": "Rücken"}, units="cm")))
    skeleton = replace(skeleton, end_sites=[False, True], channels=(("Xrotation",), ()))
    assert skeleton_to_json(skeleton, "a") == (
        '{\n  "format": "distretarget-skeleton",\n  "version": 1,\n  "name": "a",\n  "units": "cm",\n'
        '  "joints": [\n'
        '    {"name": "Hips", "parent": null, "offset": [0.0, 96.4, 0.0], "channels": ["Xrotation"]},\n'
        '    {"name": "Rücken", "parent": "Hips", "offset": [0.0, 24.0, 0.0], "end": true}\n  ]\n}\n'
    )


@st.composite
def skeletons(draw):
    """Random skeletons with End Sites, any channels, and names that often repeat."""
    count = draw(st.integers(2, 10))
    names = st.sampled_from(["a", "b", "Arm L", "ü", "\udce9", '"\\'])
    numbers = st.sampled_from(["", "", *range(count)])
    coordinates = st.floats(-1e9, 1e9)
    channels = st.lists(st.sampled_from(ALL_CHANNELS), unique=True).map(tuple)
    ends = [False] + [draw(st.booleans()) for _ in range(count - 1)]
    inner = [joint for joint in range(count) if not ends[joint]]
    try:
        return Skeleton(
            names=tuple(f"{draw(names)}{draw(numbers)}" for _ in range(count)),
            parents=[-1] + [draw(st.sampled_from([i for i in inner if i < j])) for j in range(1, count)],
            offsets=[[draw(coordinates) for _ in "xyz"] for _ in range(count)],
            channels=tuple(() if end else draw(channels) for end in ends),
            end_sites=ends,
            units=draw(st.sampled_from([None, "cm"])),
            up=draw(st.sampled_from([None, "-Z"])),
        )
    except SkeletonError:
        reject()


@given(skeletons(), st.text())
def test_round_trip(skeleton, name):
    assume(skeleton.lengths.max() >= SMALLEST)
    text = skeleton_to_json(skeleton, name)
    assert_same(load_json(text), skeleton)
    assert json.loads(text)["name"] == name
    assert valid(json.loads(text))


def test_name_and_map_are_kept(written):
    joint_map = {"Spine": "Chest", "Hips": None}
    text = skeleton_to_json(load_json(json.dumps(full())), "hero", joint_map)
    body = load_target(written(text))
    assert (body.name, body.map) == ("hero", joint_map)
    assert list(body.map) == list(joint_map)
    assert skeleton_to_json(body.skeleton, body.name, body.map) == text
    assert text.endswith('  ],\n  "map": {\n    "Spine": "Chest",\n    "Hips": null\n  }\n}\n')
    assert valid(json.loads(text))


def test_slashes_in_names_are_kept_or_refused():
    plain = tree_of(np.ones((3, 3)), ["a", "b/c", "d"])
    assert_same(load_json(skeleton_to_json(plain, "")), plain)
    mixed = tree_of(np.ones((5, 3)), ["a", "b", "c", "b/c", "d"], [-1, 0, 1, 0, 3])
    with pytest.raises(SkeletonError, match="'b/c' may mean several joints"):
        skeleton_to_json(mixed, "")

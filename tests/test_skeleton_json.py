"""Skeleton and target files: what they say and how they are written, every refusal with its place, the schema."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from bodies import person, tree_of
from hypothesis import assume, given, reject
from hypothesis import strategies as st
from input_files import file_of
from skeleton_files import HEAD_END, HIPS, MANUAL, SPINE, assert_same, full, load_json, short, valid
from table_one import table_one

from distretarget.errors import BvhError, SkeletonError, SkeletonFileError
from distretarget.io.reading import load_target, parse_full_target
from distretarget.io.skeleton_json import matching_joints, skeleton_to_json
from distretarget.skeleton import ALL_CHANNELS, DEFAULT_ROOT, DEFAULT_ROTATIONS, SMALLEST, Skeleton
from distretarget.target import SkeletonEdit


def spine(**changes):
    return full(HIPS, SPINE | changes)


def without(key, document):
    return {name: value for name, value in document.items() if name != key}


def test_full_form(written):
    joints = [HIPS, SPINE | {"channels": ["Yrotation"]}, HEAD_END, SPINE | {"name": "Leg"}]
    document = full(*joints, name="hero", units="cm", up="-Z", map={"Spine": "Chest"})
    target = load_target(written(document)).for_source(table_one())
    skeleton = target.skeleton
    assert skeleton.names == ("Hips", "Spine", "Spine_End", "Leg")
    assert skeleton.parents.tolist() == [-1, 0, 1, 0]
    assert skeleton.offsets.tolist() == [[0, 96.4, 0], [0, 24, 0], [0, 18, 0], [0, 24, 0]]
    assert skeleton.channels == (DEFAULT_ROOT, ("Yrotation",), (), DEFAULT_ROTATIONS)
    assert skeleton.end_sites.tolist() == [False, False, True, False]
    assert (skeleton.units, skeleton.up) == ("cm", "-Z")
    assert target.map == {"Spine": "Chest"}
    assert target.name == "hero"


GOOD = {
    "plain": full(),
    "named": full(name=""),
    "units and up": full(units="dm", up="-X"),
    "map": full(map={"Spine": "Chest"}),
    "empty map": full(map={}),
    "map to nothing": full(map={"Spine": None}),
    "version as 1.0": full() | {"version": 1.0},
    "end": full(HIPS, SPINE, HEAD_END),
    "end without channels": full(HIPS, SPINE, HEAD_END | {"channels": []}),
    "no end": spine(end=False),
    "no channels": spine(channels=[]),
    "six channels": spine(channels=list(DEFAULT_ROOT)),
    "blank inside a name": spine(name="Upper Spine"),
    "zero bone": full(HIPS, SPINE, SPINE | {"name": "Neck", "offset": [0, 0, 0]}),
    "same name twice": full(HIPS, SPINE, SPINE | {"parent": "Spine"}),
    "root's name twice": full(HIPS, HIPS | {"parent": "Hips"}),
    "nothing to change": short(),
    "named edit": short(name="child", scale=0.6),
    "lengths": short(lengths={"LeftKnee": 0.4}),
    "factors": short(factors={"LeftKnee": 2}, lengths={}),
}
BAD = {
    "a list": ([full()], "", "expected an object, found a list of 1"),
    "no format": (without("format", full()), "", 'has no "format"; expected "format": "distretarget-skeleton"'),
    "other format": (full(format="bvh"), "format", "expected \"distretarget-skeleton\", found 'bvh'"),
    "no version": (without("version", short()), "", 'has no "version"; expected "version": 1'),
    "other version": (full(version=2), "version", "expected 1, found 2"),
    "version true": (full(version=True), "version", "expected 1, found true"),
    "version as text": (full(version="1"), "version", "expected 1, found '1'"),
    "unknown key": (full(unit="cm"), "unit", "unknown key; did you mean 'units'?"),
    "key with blank": (full(**{"x y": 1}), '["x y"]', "unknown key; it has 'format', 'version', 'name', 'joints'"),
    "name": (full(name=3), "name", "expected a string, found 3"),
    "short name": (short(name=None), "name", "expected a string, found null"),
    "units": (full(units="px"), "units", "expected one of 'mm', 'cm', 'm', 'dm', 'in', 'ft', found 'px'"),
    "units null": (full(units=None), "units", "expected a string, found null"),
    "up": (full(up="W"), "up", "expected one of 'X', 'Y', 'Z', '-X', '-Y', '-Z', found 'W'"),
    "no joints": (short(units="cm"), "", 'has no "joints"'),
    "joints no list": (full() | {"joints": {}}, "joints", "expected a list, found an object"),
    "joints empty": (
        full() | {"joints": []},
        "joints",
        "expected at least a root and one more joint, found a list of 0",
    ),
    "root only": (full(HIPS), "joints", "all bones have length 0"),
    "zero bones": (spine(offset=[0, 0, 0]), "joints", "all bones have length 0"),
    "joint no object": (full(HIPS, "Spine"), "joints[1]", "expected an object, found 'Spine'"),
    "joint's key": (spine(chanels=[]), "joints[1].chanels", "unknown key; did you mean 'channels'?"),
    "no name": (full(HIPS, without("name", SPINE)), "joints[1]", "has no \"name\"; expected 'name', 'parent'"),
    "no parent": (full(without("parent", HIPS), SPINE), "joints[0]", 'has no "parent"'),
    "no offset": (full(HIPS, without("offset", SPINE)), "joints[1]", 'has no "offset"'),
    "joint name": (spine(name=True), "joints[1].name", "expected a string, found true"),
    "empty name": (spine(name=""), "joints[1].name", "expected a name without"),
    "name with line break": (spine(name="a\nb"), "joints[1].name", r"blanks at its ends, found 'a\nb'"),
    "name ends in line break": (spine(name="a\n"), "joints[1].name", "expected a name without"),
    "name with brace": (spine(name="a{"), "joints[1].name", "expected a name without"),
    "name with blank at its end": (spine(name="a "), "joints[1].name", "expected a name without"),
    "name of no character": (spine(name="\ud800"), "joints[1].name", "expected a name without"),
    "long name": (full(units="x" * 99), "units", f"found '{'x' * 37}...'"),
    "two numbers": (spine(offset=[0, 1]), "joints[1].offset", "expected a list of 3 numbers, found a list of 2"),
    "four numbers": (spine(offset=[0, 1, 2, 3]), "joints[1].offset", "expected a list of 3 numbers"),
    "offset no list": (spine(offset=1), "joints[1].offset", "expected a list, found 1"),
    "offset text": (spine(offset=[0, 0, "18"]), "joints[1].offset[2]", "expected a number, found '18'"),
    "offset true": (spine(offset=[0, True, 0]), "joints[1].offset[1]", "expected a number, found true"),
    "offset NaN": (spine(offset=[0, float("nan"), 0]), "joints[1].offset[1]", "expected a finite number"),
    "offset infinite": (spine(offset=[0, 0, -float("inf")]), "joints[1].offset[2]", "finite number, at most 1e+12"),
    "offset too large": (spine(offset=[0, 0, 2e12]), "joints[1].offset[2]", "at most 1e+12, found 2e+12"),
    "parent no text": (spine(parent=0), "joints[1].parent", "expected a string, found 0"),
    "unknown parent": (spine(parent="Hip"), "joints[1].parent", "no joint 'Hip'; did you mean 'Hips'?"),
    "own parent": (spine(parent="Spine"), "joints[1].parent", "expected the name of an earlier joint"),
    "later parent": (
        full(HIPS, SPINE | {"parent": "Leg"}, SPINE | {"name": "Leg"}),
        "joints[1].parent",
        "expected the name of an earlier joint, found 'Leg', which is not one",
    ),
    "ambiguous parent": (
        full(
            HIPS,
            SPINE,
            SPINE | {"name": "Leg"},
            *(HEAD_END | {"parent": p, "end": False} for p in ("Spine", "Leg")),
            SPINE | {"name": "Toe", "parent": "Spine_End"},
        ),
        "joints[5].parent",
        "'Spine_End' may be 'Spine/Spine_End', 'Leg/Spine_End'",
    ),
    "twins": (full(HIPS, SPINE, SPINE), "joints", "joints that cannot be told apart: 'Hips/Spine'"),
    "no root": (full(HIPS | {"parent": "Spine"}, SPINE), "joints[0].parent", "expected null"),
    "root not first": (full(SPINE, HIPS), "joints[1].parent", "the root must be the first joint"),
    "two roots": (spine(parent=None), "joints[1].parent", "expected the name of a joint, since 'Hips' is the root"),
    "root as end": (full(HIPS | {"end": True}, SPINE), "joints", "'Hips' is an End Site, but it is the root"),
    "end no flag": (spine(end=1), "joints[1].end", "expected true or false, found 1"),
    "end with channels": (spine(end=True, channels=["Xrotation"]), "joints", "'Spine' is an End Site, but it is"),
    "end with a child": (full(HIPS, SPINE | {"end": True}, HEAD_END), "joints", "'Spine' is an End Site, but it is"),
    "channels no list": (spine(channels="Xrotation"), "joints[1].channels", "expected a list, found 'Xrotation'"),
    "channel no text": (spine(channels=[1]), "joints[1].channels[0]", "expected a string, found 1"),
    "unknown channel": (
        spine(channels=["Xrotation", "Yrotatoin"]),
        "joints",
        "'Spine' has the unknown channel 'Yrotatoin'; did you mean 'Yrotation'",
    ),
    "channel twice": (spine(channels=["Xrotation", "Xrotation"]), "joints", "'Spine' has a channel twice: 'Xrotation'"),
    "map no object": (full(map=["Spine"]), "map", "expected an object, found a list of 1"),
    "map of no joint": (full(map={"Spin": "a"}), 'map["Spin"]', "no such joint; did you mean 'Spine'?"),
    "map to no text": (full(map={"Spine": 1}), 'map["Spine"]', "expected a string or null, found 1"),
    "both forms": (full(scale=2), "scale", 'cannot be combined with "joints"'),
    "map in the short form": (short(factors={}, map={}), "factors", 'cannot be combined with "map"'),
    "scale zero": (short(scale=0), "scale", "expected a number above 0, at least 1e-12, found 0"),
    "scale negative": (short(scale=-1.5), "scale", "expected a number above 0, at least 1e-12, found -1.5"),
    "scale text": (short(scale="2"), "scale", "expected a number, found '2'"),
    "lengths no object": (short(lengths=[]), "lengths", "expected an object, found a list of 0"),
    "length zero": (short(lengths={"Head": 0}), 'lengths["Head"]', "expected a number above 0, at least 1e-12"),
    "factor negative": (
        short(factors={"Head": -1}),
        'factors["Head"]',
        "expected a number above 0, at least 1e-12, found -1",
    ),
    "factor infinite": (short(factors={"Head": float("inf")}), 'factors["Head"]', "expected a finite number"),
    "length of no joint": (
        short(lengths={"LeftElbw": 1}),
        'lengths["LeftElbw"]',
        "no such joint; did you mean 'LeftElbow'",
    ),
    "factor of no joint": (short(factors={"Tail\n": 2}), r'factors["Tail\n"]', "no such joint; it has 'Hips'"),
    "length of the root": (short(lengths={"Hips": 1}), 'lengths["Hips"]', "the root has no bone"),
    "length and factor": (
        short(lengths={"Head": 1}, factors={"Head": 2}),
        'lengths["Head"]',
        "is in factors too; give only one of them",
    ),
}
BEYOND_THE_SCHEMA = {
    *("unknown parent", "own parent", "later parent", "ambiguous parent", "end with a child", "twins"),
    *("zero bones", "offset NaN", "map of no joint"),
    *("length of no joint", "factor of no joint", "length of the root", "length and factor"),
}


@pytest.mark.parametrize("document", GOOD.values(), ids=GOOD)
def test_good_documents(written, document):
    load_target(written(document)).for_source(table_one())
    assert valid(document)


@pytest.mark.parametrize(("document", "place", "reason"), BAD.values(), ids=BAD)
def test_bad_documents(written, document, place, reason):
    path = written(document)
    with pytest.raises(SkeletonFileError) as caught:
        load_target(path).for_source(table_one())
    assert caught.value.place == place
    assert reason in caught.value.reason
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", BAD)
def test_the_schema_refuses_what_it_can(name):
    assert valid(BAD[name][0]) == (name in BEYOND_THE_SCHEMA)


@pytest.mark.parametrize(
    ("text", "place", "reason"),
    [
        ('{"format": "distretarget-skeleton",\n "version" 1}', "line 2, column 12", "is not valid JSON: Expecting ':'"),
        ("{", "line 1, column 2", "is not valid JSON"),
        ('{"format": "distretarget-skeleton", "version": 1, "version": 1}', "version", "found it twice"),
        (json.dumps(full())[:-2] + ', {"name": "a", "name": "b"}]}', "joints[2].name", "found it twice"),
        (json.dumps(short())[:-1] + ', "factors": {"Head": 1, "Head": 2}}', 'factors["Head"]', "found it twice"),
        (json.dumps(short())[:-1] + ', "scale": NaN}', "scale", "expected a finite number"),
        (json.dumps(short())[:-1] + ', "scale": 1e999}', "scale", "expected a finite number"),
        (json.dumps(short())[:-1] + f', "scale": {"9" * 5000}}}', "scale", "expected a finite number"),
        ("[" * 100_000, "", "nested too deeply"),
        ('{"format":' * 100_000, "", "nested too deeply"),
        (json.dumps(short())[:-1] + f', "scale": {"[" * 500}{"]" * 500}}}', "scale", "expected a number, found a list"),
    ],
)
def test_bad_texts(written, text, place, reason):
    with pytest.raises(SkeletonFileError, match=re.escape(reason)) as caught:
        load_target(written(text)).for_source(table_one())
    assert caught.value.place == place


def manual_examples():
    examples = re.findall(r"```json\n(.*?)```", MANUAL.read_text("utf-8"), re.DOTALL)
    return [example for example in examples if '"distretarget-skeleton"' in example]


def test_the_manual_has_both_forms():
    assert {"joints" in json.loads(example) for example in manual_examples()} == {True, False}


@pytest.mark.parametrize("example", manual_examples())
def test_examples_of_the_manual(written, example):
    names = ("Hips", "LeftLeg", "RightLeg", "LeftForeArm")
    source = tree_of(np.ones((4, 3)), names, [-1, 0, 0, 0])
    load_target(written(example)).for_source(source)
    assert valid(json.loads(example))


NAMES = ("Hips", "Left", "Hand", "Right", "Hand")
PARENTS = (-1, 0, 1, 0, 3)


def meant_by(reference, names, parents):
    """The joints that a reference may mean, of those that have a parent in `parents`."""
    known = {}
    for joint, name in enumerate(names[: len(parents)]):
        known.setdefault(name, []).append(joint)
    return matching_joints(reference, names, parents, known)


def test_the_key_of_a_joint_means_it_alone():
    body = person()
    parents = body.parents.tolist()
    assert [meant_by(key, body.names, parents) for key in body.keys] == [[joint] for joint in range(len(body))]


@pytest.mark.parametrize(
    ("reference", "meant"),
    [
        ("Hand", [2, 4]),
        ("Left/Hand", [2]),
        ("Hips/Right/Hand", [4]),
        ("ft/Hand", []),
        ("Hips/Hand", []),
        ("/Hand", []),
        ("", []),
    ],
)
def test_parents_tell_joints_of_one_name_apart(reference, meant):
    assert meant_by(reference, NAMES, PARENTS) == meant


def test_only_the_joints_so_far_are_meant():
    assert meant_by("Hand", NAMES, PARENTS[:3]) == [2]
    assert meant_by("a/b", ("a", "b", "a", "b"), (-1, 0, 1, 2)) == [1]


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


BVH = """HIERARCHY
ROOT Hips
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Spine
  {
    OFFSET 0 24 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 0 18 0
    }
  }
}
MOTION
Frames: 1
Frame Time: 0.01
0 0 0 0 0 0 0 0 0
"""


def test_only_the_full_form_is_a_full_target():
    assert parse_full_target(file_of(json.dumps(full()), "a.json")).skeleton.names == ("Hips", "Spine")
    with pytest.raises(SkeletonFileError, match="short form needs a source"):
        parse_full_target(file_of(json.dumps(short(scale=2)), "a.json"))


def test_content_decides_between_json_and_bvh(tmp_path):
    (tmp_path / "bvh.json").write_text(BVH)
    (tmp_path / "json.bvh").write_text(f"\ufeff\r\n  {json.dumps(full(HIPS, SPINE, HEAD_END))}", "utf-8")
    bvh = load_target(tmp_path / "bvh.json").for_source(table_one())
    assert bvh.map == {}
    np.testing.assert_array_equal(bvh.skeleton.lengths, load_target(tmp_path / "json.bvh").skeleton.lengths)
    assert_same(load_target(tmp_path / "bvh.json").skeleton, bvh.skeleton)


def test_neither_json_nor_bvh(written):
    with pytest.raises(BvhError):
        load_target(written("name: hero"))


@pytest.mark.parametrize(
    ("content", "name", "kind"),
    [
        (" \n{}", "a", "skeleton"),
        ("[", "a", "skeleton"),
        ("\ufeff{", "a", "skeleton"),
        (BVH, "a.glb", "glTF"),
        (BVH, "a", "BVH"),
        ('{"asset": {}}', "a.json", "glTF"),
        ("{}", "a.gltf", "glTF"),
        ("glTF", "a.bvh", "glTF"),
        ("; FBX 7.4.0\nFBXHeaderExtension: {", "a.bvh", "FBX"),
        ("Kaydara FBX Binary", "a", "FBX"),
        ("", "a.fbx", "FBX"),
    ],
)
def test_what_a_file_is(content, name, kind):
    assert file_of(content, name).kind == kind


def test_short_form_edits_the_source(written):
    source = table_one()
    document = short(scale=2, lengths={"LeftKnee": 0.5}, factors={"LeftElbow": 1.5})
    target = load_target(written(document)).for_source(source)
    expected = 2 * source.lengths
    expected[source.index("LeftElbow")] *= 1.5
    expected[source.index("LeftKnee")] = 0.5
    np.testing.assert_allclose(target.skeleton.lengths, expected, rtol=1e-14)
    assert target.skeleton.names == source.names
    assert target.map == {}


def test_short_form_without_edits_is_the_source(written):
    assert_same(load_target(written(short())).for_source(table_one()).skeleton, table_one())


def test_edits_scale_the_root_offset_name_end_sites_and_need_bones_of_a_length():
    source = table_one().with_offsets(table_one().offsets + 1)
    np.testing.assert_array_equal(SkeletonEdit(2, {}, {}, "").apply(source).offsets, 2 * source.offsets)
    source = load_json(json.dumps(full(HIPS, SPINE, HEAD_END)))
    edited = SkeletonEdit(1, {"Spine_End": 9}, {}, "").apply(source)
    np.testing.assert_allclose(edited.lengths, [0, 24, 9])
    offsets = table_one().offsets.copy()
    offsets[2] = 0
    for edit in (SkeletonEdit(1, {"Chest2": 1}, {}, "a.json"), SkeletonEdit(1, {}, {"Chest2": 2}, "a.json")):
        with pytest.raises(SkeletonFileError, match="the bone has length 0 in the source"):
            edit.apply(table_one().with_offsets(offsets))


def test_a_source_without_bones_gives_no_target(written):
    with pytest.raises(SkeletonFileError, match="all bones have length 0"):
        load_target(written(short(scale=2))).for_source(table_one().with_offsets(np.zeros((22, 3))))

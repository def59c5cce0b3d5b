"""Map files: their meaning, every refusal with its place, and that a written map changes nothing when used."""

import json
import re

import pytest
from bodies import CORPUS, SAMPLES, body_of, matched, needs_corpus, person, sample_target, swaying
from bvh_texts import format_bvh
from skeleton_files import MANUAL

from distretarget import read_bvh, retarget
from distretarget.errors import MatchingError, SkeletonFileError
from distretarget.io.map_json import joint_map, load_map, map_to_json
from distretarget.io.reading import load_target
from distretarget.matching.matching import find_matching
from distretarget.target import Target


@pytest.fixture
def written(tmp_path):
    def write(text, name="map.json"):
        path = tmp_path / name
        path.write_text(text if isinstance(text, str) else json.dumps(text), "utf-8")
        return path

    return write


def test_a_map_file_is_an_object(written):
    pairs = {"Head": "Skull", "Tail": None, "Arm/Hand": "L Hand"}
    assert load_map(written(pairs)).pairs == pairs
    assert load_map(written({})).pairs == {}


@pytest.mark.parametrize(
    ("text", "place", "reason"),
    [
        ('["Head"]', "", "expected an object, found a list of 1"),
        ("Head: Skull", "line 1, column 1", "is not valid JSON: Expecting value"),
        ('{"Head": 1}', '["Head"]', "expected a string or null, found 1"),
        ('{"Head": ["Skull"]}', '["Head"]', "expected a string or null, found a list of 1"),
        ('{"Head": "Skull", "Head": null}', '["Head"]', "expected each key once, found it twice"),
    ],
)
def test_bad_files(written, text, place, reason):
    path = written(text)
    with pytest.raises(SkeletonFileError, match=re.escape(reason)) as caught:
        load_map(path)
    assert caught.value.place == place
    assert str(caught.value).startswith(f"{path}: ")


def test_a_map_file_counts_before_the_target(written):
    body = person()
    goal = Target(body, {"Head": "Neck", "Neck": None}, "")
    pairs = joint_map(body, goal, "body.json", load_map(written({"Head": "Chest"})))
    assert pairs == {"Head": "Chest", "Neck": None}
    assert joint_map(body, goal, "body.json", load_map(None)) == goal.map
    goal = Target(person(), {"Head": "Haed"}, "")
    assert joint_map(person(), goal, "body.json", load_map(written({"Head": "Head"}))) == {"Head": "Head"}


@pytest.mark.parametrize(
    ("in_target", "in_file", "says"),
    [
        ({"Haed": "Head"}, {}, "body.json: map[\"Haed\"]: the target has no such joint; did you mean 'Head'?"),
        ({"Head": "Haed"}, {}, "body.json: map[\"Head\"]: the source has no joint 'Haed'; did you mean 'Head'?"),
        ({}, {"Haed": "Head"}, "map.json: [\"Haed\"]: the target has no such joint; did you mean 'Head'?"),
        ({}, {"Head": "Haed"}, "map.json: [\"Head\"]: the source has no joint 'Haed'; did you mean 'Head'?"),
    ],
)
def test_joints_that_are_not_there(written, in_target, in_file, says):
    with pytest.raises(SkeletonFileError) as caught:
        joint_map(person(), Target(person(), in_target, ""), "body.json", load_map(written(in_file)))
    assert str(caught.value).endswith(says)


def test_the_written_map_has_each_joint_but_end_sites():
    body = person()
    text = map_to_json(find_matching(body_of(body), body_of(body), {"Head": None, "LeftToe_End": "RightToe_End"}))
    pairs = json.loads(text)
    names = [body.keys[joint] for joint in body.depth_first if not body.end_sites[joint]]
    assert [key for key in pairs if key != "LeftToe_End"] == names
    assert pairs == {name: name for name in names} | {"Head": None, "LeftToe_End": "RightToe_End"}
    assert text.splitlines()[1] == '  "Hips": "Hips",'
    assert text.endswith('"\n}\n')


def test_joints_that_bend_along_a_spine_are_left_out():
    source, target = person(), sample_target("rigs/xsens_t").skeleton
    matching = find_matching(body_of(source), body_of(target))
    bending = {target.keys[j] for j in range(len(target)) if matching.drivers[j] < 0 <= matching.rotation_sources[j, 0]}
    assert bending
    ends = {target.keys[j] for j in range(len(target)) if target.end_sites[j]}
    assert json.loads(map_to_json(matching)).keys() == set(target.keys) - ends - bending


def assert_same_with_its_own_map(source, target):
    source = read_bvh(source)
    target = load_target(target).skeleton
    matching = matched(source, target)
    again = retarget(source, target, joint_map=json.loads(map_to_json(matching)))
    assert format_bvh(retarget(source, target).motion) == format_bvh(again.motion)


@pytest.mark.parametrize("rig", sorted(path.name for path in (SAMPLES / "rigs").glob("*_a.json")))
def test_the_map_as_written_changes_nothing(rig):
    assert_same_with_its_own_map(SAMPLES / "wave.bvh", SAMPLES / "rigs" / rig)


@needs_corpus
@pytest.mark.parametrize(
    ("source", "target"),
    [
        ("cmu_mb/12_01.bvh", "cmu_daz/12_01.bvh"),
        ("animated_drawings/dab.bvh", "makehuman/walk1.bvh"),
        ("bvhio/example.bvh", "cmu_mb/02_01.bvh"),
    ],
)
def test_the_map_of_real_files_changes_nothing(source, target):
    assert_same_with_its_own_map(CORPUS / source, CORPUS / target)


def test_a_map_full_of_nulls_is_refused():
    motion = swaying(person())
    with pytest.raises(MatchingError, match="no joint of the target has a driver"):
        retarget(motion, person(), joint_map=dict.fromkeys(person().keys))


def test_the_manual_has_a_map(written):
    examples = re.findall(r"```json\n(.*?)```", MANUAL.read_text("utf-8"), re.DOTALL)
    maps = [load_map(written(example)).pairs for example in examples if '"format"' not in example]
    assert [set(map(type, pairs.values())) for pairs in maps] == [{str, type(None)}]

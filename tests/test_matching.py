"""Which joint drives which: maps, equal names, parts of bodies, and refusals; and what nothing drives, in words."""

import re
from dataclasses import replace

import numpy as np
import pytest
from bodies import PERSON, SAMPLES, body_of, matched, reordered, sample_target, taken, tree_of, with_bone
from named_bodies import tree

from distretarget.body.body import Body
from distretarget.errors import MapError, MatchingError
from distretarget.io.reading import load_target
from distretarget.matching.matching import find_matching, refusal
from distretarget.matching.unmatched import others_without_source, parts_without_source
from distretarget.pipeline.retargeting import with_advice

RIGS = {path.stem: load_target(path).skeleton for path in sorted((SAMPLES / "rigs").glob("*.json"))}
MIXAMO = RIGS["mixamo_t"]
FINGERS = ("Thumb", "Index", "Middle", "Ring", "Pinky")

rigs = pytest.mark.parametrize("body", [PERSON, *RIGS.values()], ids=["person", *RIGS])


def renamed(skeleton, rename):
    """The skeleton with names given by a function or {old: new}."""
    rename = rename if callable(rename) else lambda name, names=rename: names.get(name, name)
    return replace(skeleton, names=tuple(map(rename, skeleton.names)))


def swapped(name):
    return re.sub("Left|Right", lambda side: {"Left": "Right", "Right": "Left"}[side[0]], name)


def chain(*names, parents=(), ends=()):
    """A rope, which is no human body; joints named in `ends` are End Sites."""
    return tree_of(np.outer(np.arange(len(names)) > 0, [0, 1.0, 0]), names, parents, ends=ends)


def without(skeleton, pattern):
    """The skeleton without the joints whose names fit a pattern, and all below them."""
    kept = [0]
    for joint in range(1, len(skeleton)):
        if skeleton.parents[joint] in kept and not re.search(pattern, skeleton.names[joint]):
            kept.append(joint)
    return taken(skeleton, kept)


def seated(skeleton):
    """The skeleton with its legs pointing forward, at right angles to the trunk."""
    legs = [bool(re.search("Knee|Ankle", name)) for name in skeleton.names]
    return skeleton.with_offsets(
        np.where(np.array(legs)[:, None], skeleton.offsets[:, [0, 2, 1]] * (1, 1, -1), skeleton.offsets)
    )


def named(matching):
    """{key of the target: key of its driver}, without those that have none."""
    pairs = zip(matching.target.skeleton.keys, matching.drivers, strict=True)
    return {key: matching.source.skeleton.keys[driver] for key, driver in pairs if driver >= 0}


# Equal names


@rigs
@pytest.mark.parametrize("seed", range(3))
def test_equal_names_match_in_any_order(body, seed):
    other, order = reordered(body, seed)
    matching = matched(body, other)
    drivers = np.where(np.isin(order, list(Body.of(body).handles)), -1, order)
    np.testing.assert_array_equal(matching.drivers, drivers)
    np.testing.assert_array_equal(matching.rotation_sources, np.stack([drivers, drivers], axis=1))
    assert not matching.blend.any()
    for joint, how in zip(drivers, matching.method, strict=True):
        assert how == ("" if joint < 0 else "tip" if body.end_sites[joint] else "name")


def test_namespaces_and_case_do_not_matter_but_exact_names_come_first():
    source, target = chain("Rope:Base", "Rope:Middle", "top"), chain("BASE", "x:y:middle", "z:Top")
    assert named(matched(source, target)) == dict(zip(target.names, source.names, strict=True))
    source, target = chain("base", "a:Top", "Top", "b:mid"), chain("base", "Top", "mid")
    assert named(matched(source, target)) == {"base": "base", "Top": "Top", "mid": "b:mid"}
    source = chain("base", "mid", "a:hand", "b:hand", parents=[-1, 0, 1, 1])
    target = chain("base", "mid", "hand")
    assert named(matched(source, target)) == {"base": "base", "mid": "mid"}


def test_half_of_the_names_are_enough_without_a_body_and_fewer_are_refused():
    source = chain("a", "b", "c", "d", "E", ends="E")
    matching = matched(source, chain("x", "y", "c", "d", "E", ends="E"))
    assert named(matching) == {"c": "c", "d": "d", "E": "E"}
    with pytest.raises(MatchingError, match="only 1 of 4 joints of the target have a driver by name"):
        matched(source, chain("x", "y", "z", "d", "E", ends="E"))


def test_without_legs_the_path_is_that_of_the_first_joint_with_a_driver():
    rope = chain("a", "b", "c")
    assert matched(rope, rope).legs is None
    assert matched(rope, rope).pelvis == 0
    assert matched(rope, rope, {"a": None}).pelvis == 1
    assert matched(rope, rope, {"c": None}).pelvis == 0


# End Sites


def test_end_sites_match_in_order_whatever_they_are_called_and_those_left_over_have_no_driver():
    source = chain("a", "b", "p", "q", parents=[-1, 0, 1, 1], ends="pq")
    target = chain("a", "b", "u", "v", "w", parents=[-1, 0, 1, 1, 1], ends="uvw")
    assert named(matched(source, target)) == {"a": "a", "b": "b", "u": "p", "v": "q"}
    assert named(matched(target, source)) == {"a": "a", "b": "b", "p": "u", "q": "v"}
    bare = taken(PERSON, np.flatnonzero(~PERSON.end_sites))
    np.testing.assert_array_equal(matched(bare, PERSON).drivers, [*range(22), *[-1] * 5])
    np.testing.assert_array_equal(matched(PERSON, bare).drivers, np.arange(22))
    matching = matched(PERSON, renamed(PERSON, {"Head_End": "Top", "LeftToe_End": "Nail"}))
    np.testing.assert_array_equal(matching.drivers, np.arange(len(PERSON)))


def test_the_end_of_a_limb_may_be_a_joint_on_one_body_and_an_end_site_on_the_other():
    source, target = chain("a", "b", "tip"), chain("a", "b", "End", ends=["End"])
    for one, other in ((source, target), (target, source)):
        matching = matched(one, other)
        np.testing.assert_array_equal(matching.drivers, [0, 1, 2])
        assert matching.method == ("name", "name", "tip")


# Maps


def test_a_map_comes_before_names():
    matching = matched(PERSON, PERSON, {"LeftWrist": "LeftElbow", "Head": "Head"})
    assert named(matching)["LeftWrist"] == "LeftElbow"
    changed = [PERSON.index("LeftWrist"), PERSON.index("LeftWrist_End")]
    np.testing.assert_array_equal(np.delete(matching.drivers - np.arange(len(PERSON)), changed), 0)
    assert [matching.method[PERSON.index(name)] for name in ("LeftWrist", "Head", "Neck")] == ["map", "map", "name"]


@pytest.mark.parametrize("source", [PERSON, MIXAMO], ids=["equal names", "other names"])
def test_a_map_changes_no_other_joint_than_those_it_names(source):
    before, after = matched(source, PERSON), matched(source, PERSON, {"Head_End": None, "LeftKnee": None})
    changed = [PERSON.index("Head_End"), PERSON.index("LeftKnee")]
    np.testing.assert_array_equal(after.drivers[changed], -1)
    np.testing.assert_array_equal(after.rotation_sources[changed], -1)
    for name in ("drivers", "rotation_sources", "blend"):
        found, expected = (np.delete(getattr(matching, name), changed, axis=0) for matching in (after, before))
        np.testing.assert_array_equal(found, expected)
    assert {after.method[joint] for joint in changed} == {""}


def test_a_map_makes_up_for_names_that_say_nothing():
    source, target = chain("a", "b", "c"), chain("x", "y", "z")
    with pytest.raises(MatchingError):
        matched(source, target)
    assert named(matched(source, target, {"x": "a", "y": "c"})) == {"x": "a", "y": "c"}


@pytest.mark.parametrize(
    ("explicit", "reason"),
    [
        ({"LeftWirst": "LeftWrist"}, "the target has no such joint; did you mean 'LeftWrist'"),
        ({"LeftWrist": "LeftWirst"}, "the source has no joint 'LeftWirst'; did you mean 'LeftWrist'"),
        ({"Nose": None}, "the target has no such joint"),
    ],
)
def test_a_map_of_joints_that_are_not_there_is_refused(explicit, reason):
    with pytest.raises(MapError, match=reason) as caught:
        matched(PERSON, PERSON, explicit)
    assert [caught.value.key] == list(explicit)


# Parts of the body


def test_equal_names_rank_above_parts_and_parts_above_shapes():
    others = {"Collar": "Clavicle", "Shoulder": "UpperArm", "Elbow": "LowerArm", "Wrist": "Hand", "Hip": "UpperLeg"}
    others |= {"Knee": "LowerLeg", "Ankle": "Foot", "Toe": "Toes", "Hips": "Pelvis", "Chest": "Spine", "Neck": "Neck01"}
    words = {f"{side}{word}": f"{side}{other}" for side in ("", "Left", "Right") for word, other in others.items()}
    words |= {"Chest2": "Spine2", "Chest3": "Spine3", "Head": "TheHead"}
    said, unsaid = (renamed(PERSON, words), renamed(PERSON, lambda name: name[::-1]))
    sure = [matched(PERSON, target).confidence[~PERSON.end_sites] for target in (PERSON, said, unsaid)]
    assert np.all(sure[0] > sure[1])
    assert np.all(sure[1] > sure[2])


def test_a_body_whose_names_say_nothing_matches_by_its_shape():
    matching = matched(PERSON, renamed(PERSON, lambda name: name[::-1]))
    np.testing.assert_array_equal(matching.drivers, np.arange(len(PERSON)))
    assert set(matching.method) == {"shape", "tip"}


@pytest.mark.parametrize(("source", "target"), [("lafan1_t", "xsens_t"), ("xsens_t", "unreal_t")])
def test_a_spine_of_another_number_of_joints_turns_between_neighbours_in_order(source, target):
    matching = matched(RIGS[source], RIGS[target])
    source, target, blend = matching.source.anatomy, matching.target.anatomy, matching.blend
    spine = list(target.spine)
    first, second = np.searchsorted(source.spine, matching.rotation_sources[spine]).T
    assert len(source.spine) != len(target.spine)
    assert np.all((second == first + 1) | (first == second) & (second == len(source.spine) - 1))
    assert np.all(np.diff(first + blend[spine]) >= 0)
    assert np.all((blend >= 0) & (blend <= 1))
    others = np.setdiff1d(np.flatnonzero(matching.drivers >= 0), [*target.spine, *target.neck])
    np.testing.assert_array_equal(matching.rotation_sources[others], matching.drivers[others, None].repeat(2, axis=1))
    assert not blend[others].any()


def test_a_joint_the_source_has_not_follows_its_parent():
    target = with_bone(with_bone(PERSON, "LeftForearmTwist", "LeftElbow"), "Tail", "Hips")
    matching = matched(PERSON, target)
    np.testing.assert_array_equal(matching.drivers, [*range(len(PERSON)), -1, -1])
    np.testing.assert_array_equal(matching.rotation_sources[-2:], -1)
    assert matching.method[-2:] == ("", "")


@pytest.mark.parametrize(
    ("body", "name"),
    [
        *((PERSON, name) for name in ("Head", "LeftWrist", "RightToe", "Chest2", "LeftElbow", "RightKnee", "LeftHip")),
        (RIGS["lafan1_t"], "LeftArm"),
    ],
    ids=lambda value: value if isinstance(value, str) else str(len(value)),
)
def test_one_joint_of_another_name_costs_no_other_joint_its_driver(body, name):
    odd = body.index(name)
    drivers = matched(body, renamed(body, {name: "Qqq"})).drivers
    joints = [joint for joint in np.flatnonzero(~body.end_sites) if joint != odd]
    np.testing.assert_array_equal(drivers[joints], joints)
    assert drivers[odd] in (-1, odd)


@pytest.mark.parametrize(("held", "expected"), [("LeftWrist", "Sword"), ("Head", None)])
def test_equal_names_of_what_is_no_part_of_the_body_match_where_they_hang_from_the_same_part(held, expected):
    source, target = with_bone(MIXAMO, "Sword", "mixamorig:LeftHand"), with_bone(PERSON, "Sword", held)
    assert named(matched(source, target)).get("Sword") == expected


@pytest.mark.parametrize("fingers", [("Index",), ("Thumb", "Index", "Middle"), FINGERS])
def test_fingers_match_if_the_source_has_most_of_them(fingers):
    gone = "|".join(f"Hand{finger}" for finger in FINGERS if finger not in fingers)
    source = without(MIXAMO, gone) if gone else MIXAMO
    pairs = named(matched(source, RIGS["unreal_t"]))
    driven = {name.split("_")[0] for name in pairs if re.match("thumb|index|middle|ring|pinky", name)}
    assert driven == ({finger.lower() for finger in fingers} if len(fingers) > 1 else set())
    if "Middle" in fingers:
        assert pairs["middle_02_r"] == "mixamorig:RightHandMiddle2"


def test_one_finger_that_stands_for_all_moves_none_of_five_by_its_name():
    alone = without(MIXAMO, "Hand(Thumb|Middle|Ring|Pinky)").without_namespaces
    assert not any("HandIndex" in name for name in named(matched(alone, MIXAMO)))
    assert "mixamorig:LeftHandIndex1" in named(matched(alone, without(MIXAMO, "Hand(Thumb|Middle|Ring|Pinky)")))


# Left and right


def test_left_drives_left_though_the_names_of_one_body_are_crossed():
    crossed = renamed(PERSON, swapped)
    for source, target in ((PERSON, crossed), (crossed, PERSON)):
        np.testing.assert_array_equal(matched(source, target).drivers, np.arange(len(PERSON)))
    np.testing.assert_array_equal(matched(crossed, crossed).drivers, np.arange(len(PERSON)))
    assert named(matched(crossed, MIXAMO))["mixamorig:LeftArm"] == "RightShoulder"


# Refusals


def refused(source, target, reason, explicit=None):
    with pytest.raises(MatchingError, match=reason) as caught:
        matched(source, target, explicit)
    matching = find_matching(body_of(source), body_of(target), explicit)
    assert refusal(matching) == caught.value.fault
    assert "\n" not in str(caught.value)
    for side, body in ((caught.value.target, target), (caught.value.source, source)):
        assert side == tuple(np.array(body.keys)[~body.end_sites])
        assert repr(side[0]) in str(caught.value) or "closest names" in str(caught.value)
    assert "map" in str(caught.value)
    assert len(str(caught.value)) < 350
    return str(caught.value)


@pytest.mark.parametrize(
    ("source", "target", "body"),
    [
        (chain("Head", "end"), MIXAMO, "the source"),
        (MIXAMO, chain("Head", "line", "end"), "the target"),
        (chain("rope", "end"), chain("line", "end", "hook"), "either of them"),
    ],
)
def test_what_is_no_body_is_refused_with_the_names_of_both(source, target, body):
    refused(source, target, rf"only \d of \d+ joints .*, and no human body is recognised in {body}")


def test_a_refusal_names_the_closest_pairs():
    told = refused(chain("rope1", "rope2"), chain("rope1x", "anchor"), "only 0 of 2 joints of the target have a driver")
    assert "closest names: 'rope1x' and 'rope1'; say in a map" in told


def test_a_body_on_all_fours_is_refused():
    refused(seated(PERSON), MIXAMO, "the source seems to go on all fours")
    refused(MIXAMO, seated(PERSON), "the target seems to go on all fours")
    matched(seated(PERSON), PERSON)  # equal names need no guess by parts


def test_bodies_that_share_neither_arms_nor_legs_are_refused():
    refused(without(PERSON, "Collar"), without(MIXAMO, "UpLeg"), "source and target share neither arms nor legs")


def test_a_body_without_legs_matches_arms_and_trunk():
    pairs = named(matched(without(PERSON, "Hip$"), MIXAMO))
    assert [pairs[f"mixamorig:Left{part}"] for part in ("Arm", "ForeArm")] == ["LeftShoulder", "LeftElbow"]
    assert "mixamorig:LeftLeg" not in pairs


def test_a_body_whose_arms_and_legs_follow_nothing_is_refused_however_many_names_are_equal():
    ornaments = [f"ornament{k}" for k in range(60)]
    source, target = chain(*ornaments), PERSON
    for name in ornaments:
        target = with_bone(target, name, "Head")
    refused(source, target, "no arm and no leg has a driver, and no human body is recognised in the source")


def test_a_map_that_leaves_nothing_is_refused():
    refused(PERSON, PERSON, "no joint of the target has a driver", dict.fromkeys(PERSON.keys))


@pytest.mark.parametrize("explicit", [{"hook": "end"}, {"line": "rope"}])
def test_a_map_is_never_refused_for_lack_of_names(explicit):
    matching = matched(chain("rope", "end"), chain("line", "hook"), explicit)
    assert named(matching).items() >= explicit.items()


@pytest.mark.parametrize(
    ("fault", "file"),
    [
        ("the source seems to go on all fours", "walk.bvh"),
        ("the target seems to go on all fours", "hero.glb"),
        ("source and target share neither arms nor legs", "hero.glb"),
    ],
)
def test_the_file_that_is_at_fault_is_named(fault, file):
    with pytest.raises(MatchingError, match=f"^{file}: {fault}"), with_advice("walk.bvh", "hero.glb"):
        raise MatchingError(fault, ["Hips"], ["Hips"])


ONTO = sample_target("rigs/mixamo_t").skeleton


def told(source, target, explicit=None):
    matching = find_matching(body_of(source), body_of(target), explicit)
    return [*parts_without_source(matching)], [*others_without_source(matching)]


def none_of(*names):
    return {f"mixamorig:{side}{name}": None for name in names for side in ("Left", "Right")}


def test_a_body_that_follows_in_all_its_parts_needs_no_line():
    assert told(PERSON, PERSON) == ([], [])


@pytest.mark.parametrize(
    ("explicit", "line"),
    [
        ({}, "no source joint drives fingers of the target"),
        (none_of("Shoulder"), "no source joint drives shoulders and fingers of the target"),
        ({"mixamorig:LeftShoulder": None}, "no source joint drives left shoulder and fingers of the target"),
        (none_of("Hand"), "no source joint drives hands and fingers of the target"),
        (
            none_of("Arm", "ForeArm", "Hand", "ToeBase"),
            "no source joint drives arms, hands, fingers and toes of the target",
        ),
        ({"mixamorig:RightToeBase": None}, "no source joint drives fingers and right toes of the target"),
        (none_of("Arm"), "no source joint drives 2 arm joints and fingers of the target"),
        ({"mixamorig:Head": None}, "no source joint drives fingers and head of the target"),
    ],
)
def test_parts_are_named_as_wholes_or_with_a_number(explicit, line):
    assert told(PERSON, ONTO, explicit)[0] == [line]


def test_a_single_part_without_a_driver_has_a_line():
    assert told(PERSON, PERSON, {"LeftCollar": None})[0] == ["no source joint drives left shoulder of the target"]


def test_joints_of_face_hair_and_twist_are_counted_in_a_line_of_their_own():
    target = PERSON
    for name in ("Hair1", "Hair2", "Jaw", "LeftElbowTwist"):
        target = with_bone(target, name, "LeftElbow" if "Twist" in name else "Head")
    line = "4 other joints of the target follow their parents: 'Hair1', 'Hair2', 'Jaw' and 1 more"
    assert told(PERSON, target) == ([], [line])


def test_what_is_no_human_body_has_no_parts():
    line = "1 joint of the target follows its parent: 'end'"
    assert told(tree("a>b>c>d"), tree("a>b>c>d(end|other>tail)"), {"other": "c", "tail": "d"}) == ([], [line])


def test_arms_that_are_not_recognised_are_told():
    """Arms with other names, and shorter than a person's, so that the shape does not show them either."""
    arms = [j for name in ("LeftCollar", "RightCollar") for j in PERSON.subtree(PERSON.index(name))]
    offsets = np.array(PERSON.offsets)
    offsets[arms] *= 0.05
    names = tuple(f"b{joint}" if joint in arms else name for joint, name in enumerate(PERSON.names))
    parts, others = told(PERSON, replace(PERSON, names=names, offsets=offsets))
    lost = "left arm and right arm of the target not recognised"
    assert parts[0] == f"{lost}, so they do not move: name their joints in a map"
    assert others == ["8 other joints of the target follow their parents: 'b6', 'b7', 'b8' and 5 more"]


@pytest.mark.parametrize("source", RIGS)
def test_confidence_and_method_are_those_of_what_has_a_driver(source):
    matching = matched(RIGS[source], MIXAMO)
    known = matching.drivers >= 0
    np.testing.assert_array_equal(known, [how != "" for how in matching.method])
    assert np.all(matching.confidence[known] > 0.5)
    assert np.all(matching.confidence[~known] == 0)

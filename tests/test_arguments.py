"""Every public call checks what it is given, and raises an error of this package in one line; settings."""

import math
import pickle
from dataclasses import replace

import numpy as np
import pytest
from bodies import SAMPLES, clapping, lengthened, person, swaying

import distretarget as d
from distretarget import Options, retarget
from distretarget.errors import SettingsError
from distretarget.objectives.activation import ContactSettings

BODY, CLIP = person(), swaying(person(), frames=2)
EDIT = d.SkeletonEdit(1.0, {}, {}, "edit.json")
CLIPS = SAMPLES / "clap.bvh", SAMPLES / "child.json"
JOINTS = len(BODY)


def is_refused(call):
    """Check that a call is refused in one line by an error of this package."""
    with pytest.raises(d.DistretargetError) as refused:
        call()
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    "changes",
    [
        {"names": None},
        {"names": tuple(range(JOINTS))},
        {"parents": None},
        {"parents": ["a"] * JOINTS},
        {"parents": BODY.parents + 0.5},
        {"parents": np.zeros(JOINTS, int)},
        {"offsets": "a"},
        {"offsets": BODY.offsets * 1j},
        {"offsets": np.nan * BODY.offsets},
        {"end_sites": None},
        {"end_sites": np.ones(JOINTS, bool)},
        {"channels": None},
        {"channels": (("Wrotation",), *BODY.channels[1:])},
        {"channels": BODY.channels[1:]},
        {"channels": (("Xrotation",),) * JOINTS},
        {"channels": ((7,),) * JOINTS},
        {"up": "Q"},
        {"up": 3},
        {"units": "parsec"},
    ],
    ids="".join,
)
def test_skeletons(changes):
    is_refused(lambda: replace(BODY, **changes))


@pytest.mark.parametrize("lengths", ["x", [1, 2], -np.ones(JOINTS), np.full(JOINTS, np.nan), 1e30 * np.ones(JOINTS)])
def test_lengths_of_bones(lengths):
    is_refused(lambda: BODY.with_lengths(lengths))


@pytest.mark.parametrize("key", ["Tail", 3, None])
def test_keys_of_joints(key):
    is_refused(lambda: BODY.index(key))


@pytest.mark.parametrize(
    "options",
    [
        {"objective": "papr"},
        {"objective": ["paper"]},
        {"supports": "all"},
        {"environment": 1},
        {"root_scale": -1},
        {"root_scale": float("nan")},
        {"root_scale": "1"},
        {"root_scale": True},
        {"source_up": "Q"},
        {"target_up": np.eye(3)},
        {"root_offset": "both"},
        {"root_follows": "hips"},
    ],
    ids="".join,
)
def test_options_of_retarget(options):
    (name,) = options
    with pytest.raises(SettingsError, match=f"^{name} is .*; expected ") as refused:
        d.Options(**options)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("joint_map", [["Hips"], 3, {1: 2}, {"Hips": 2}, {"Tail": None}, {"Hips": "Tail"}], ids=str)
def test_maps(joint_map):
    bodies = d.Body.of(BODY), d.Body.of(BODY)
    is_refused(lambda: d.retarget(CLIP, BODY, joint_map=joint_map))
    is_refused(lambda: d.diff(CLIP, CLIP, joint_map))
    is_refused(lambda: d.match(*bodies, joint_map))
    is_refused(lambda: d.retarget(CLIP, d.Target(BODY, joint_map, "")))


@pytest.mark.parametrize("scale", [-1, 0, "a", None, float("inf")])
def test_edits(scale):
    is_refused(lambda: d.SkeletonEdit(scale, {}, {}, "x"))
    is_refused(lambda: d.SkeletonEdit(1.0, {"LeftElbow": scale}, {}, "x"))
    is_refused(lambda: d.SkeletonEdit(1.0, {}, {"LeftElbow": scale}, "x"))


OTHER_KINDS = {
    "motion": lambda: d.Motion.of_translations(None, CLIP.translations, CLIP.rotations, "0.01"),
    "shape of a motion": lambda: d.Motion.of_translations(BODY, CLIP.translations[0], CLIP.rotations, "0.01"),
    "frames of a motion": lambda: d.Motion.of_translations(BODY, CLIP.translations[:1], CLIP.rotations, "0.01"),
    "to_dict": lambda: CLIP.to_dict(["6d"]),
    "retarget": lambda: d.retarget("clip.bvh", BODY),
    "target": lambda: d.retarget(CLIP, "child.json"),
    "settings": lambda: d.retarget(CLIP, BODY, settings={}),
    "mapper": lambda: d.retarget(CLIP, BODY, mapper=3),
    "progress": lambda: d.retarget(CLIP, BODY, progress=3),
    "value of a setting": lambda: d.ContactSettings(reach="a"),
    "scene": lambda: d.retarget_scene(None, None),
    "performer": lambda: d.retarget_scene(["clip.bvh"], [BODY]),
    "scale of the world": lambda: d.retarget_scene([CLIP], [BODY], world_scale="a"),
    "supports of a scene": lambda: d.retarget_scene([CLIP], [BODY], supports="all"),
    "settings of a scene": lambda: d.retarget_scene([CLIP], [BODY], settings=3),
    "maps of a scene": lambda: d.retarget_scene([CLIP], [BODY], joint_maps=[3]),
    "mapper of a scene": lambda: d.retarget_scene([CLIP], [BODY], mapper=3),
    "motion of a prop": lambda: d.Prop(name="box", motion=BODY),
    "scale of a prop": lambda: d.Prop(name="box", motion=CLIP, scale=True),
    "grip of a prop": lambda: d.Prop(name="box", motion=CLIP, held_by=("LeftWrist",)),
    "grip": lambda: d.Grip("lead", "LeftWrist"),
    "prop_of": lambda: d.prop_of(BODY, "LeftWrist"),
    "load_scene": lambda: d.load_scene(3),
    "props of a diff": lambda: d.diff_scenes([d.diff(CLIP, CLIP)], [(BODY, BODY)]),
    "frames of a prop": lambda: d.diff_scenes([d.diff(CLIP, CLIP)], [(CLIP[:0], CLIP)]),
    "diff": lambda: d.diff("a.bvh", "b.bvh"),
    "diff of skeletons": lambda: d.diff(CLIP, BODY),
    "match": lambda: d.match(CLIP, BODY),
    "body": lambda: d.Body.of("x"),
    "body of a motion": lambda: d.Body.of_motion(BODY),
    "lengths": lambda: d.SkeletonEdit(1.0, ["LeftElbow"], {}, "x"),
    "edit of a motion": lambda: EDIT.apply(CLIP),
    "skeleton of a target": lambda: d.Target(None, {}, ""),
    "motion of a target": lambda: d.Target(BODY, {}, "", 3),
    "world": lambda: d.World("Q", "Y", "added"),
    "read_bvh": lambda: d.read_bvh(None),
    "load_target": lambda: d.load_target(3),
    "write_bvh": lambda: d.write_bvh("x.bvh", BODY),
    "path of write_bvh": lambda: d.write_bvh(b"x", CLIP),
    "write_npz": lambda: d.write_npz("x.npz", BODY),
    "rotations of write_npz": lambda: d.write_npz("x.npz", CLIP, rotations="euler"),
    "write_report": lambda: d.write_report("x.html", CLIP),
    "path of load_build": lambda: d.load_build(3),
    "no path of load_build": lambda: d.load_build(None),
    "text as factor of scaled": lambda: CLIP.scaled("2"),
    "array as factor of scaled": lambda: CLIP.scaled(np.array([1.0, 2.0])),
    "array as fps": lambda: d.read_motion(CLIPS[0], fps=np.array([30.0, 20.0])),
    "empty array as fps": lambda: d.read_motion(CLIPS[0], fps=np.array([])),
    "sources": lambda: d.convert_folder(3, CLIPS[1], "out"),
    "folder": lambda: d.convert_folder(*CLIPS, None),
    "recipe": lambda: d.convert_folder(*CLIPS, "out", recipe={}),
    "options": lambda: d.Recipe(options={}),
    "jobs": lambda: d.convert_folder(*CLIPS, "out", jobs="2"),
    "no jobs": lambda: d.convert_folder(*CLIPS, "out", jobs=0),
    "include": lambda: d.convert_folder(*CLIPS, "out", include=3),
    "reports": lambda: d.convert_folder(*CLIPS, "out", report="x.html", reports="all"),
}


@pytest.mark.parametrize("call", OTHER_KINDS.values(), ids=OTHER_KINDS)
def test_arguments_of_another_kind(call, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    is_refused(call)
    assert not list(tmp_path.iterdir())


def test_numbers_of_numpy_are_numbers():
    assert d.Options(root_scale=np.float32(2)).root_scale == 2


@pytest.mark.parametrize("text", ["x", "0", "nan", 0.05, None])
def test_a_motion_is_resampled_to_a_frame_time_alone(text):
    with pytest.raises(d.MotionError, match="frame_time_text is"):
        CLIP.resampled(text)


def test_a_motion_of_no_numbers_is_not_told_of_as_too_large():
    motion = d.Motion(CLIP.skeleton, np.full_like(CLIP.root_positions, np.nan), CLIP.rotations, CLIP.frame_time_text)
    with pytest.raises(d.MotionError, match="positions that are not finite"):
        d.retarget(motion, CLIP.skeleton)


DEFAULT = ContactSettings()
BONES_ALONE = Options(skin="none")


def test_settings_survive_pickling():
    changed = replace(DEFAULT, reach=0.1, blend=0.2)
    assert pickle.loads(pickle.dumps(changed)) == changed


@pytest.mark.parametrize(
    ("change", "place"),
    [
        ({"blend": -0.1}, "blend is -0.1"),
        ({"reach": math.nan}, "reach is nan"),
        ({"foot_lock": math.inf}, "foot_lock is inf"),
        ({"strength": "much"}, "strength is 'much'"),
    ],
)
def test_values_without_meaning_are_refused_in_one_line(change, place):
    with pytest.raises(SettingsError, match=place) as refused:
        replace(DEFAULT, **change)
    assert "\n" not in str(refused.value)


def test_the_settings_given_are_those_that_count():
    source, body = clapping(np.ones(6)), lengthened(person(), {"Wrist": 1.5})
    nothing = retarget(source, body, BONES_ALONE, settings=replace(DEFAULT, strength=0.0, foot_lock=0.0))
    np.testing.assert_allclose(nothing.motion.world_rotations, nothing.rotation_copy.world_rotations, atol=1e-12)
    stiff, soft = (
        retarget(source, body, BONES_ALONE, settings=replace(DEFAULT, strength=strength)).metrics["result"][
            "contact_error"
        ]
        for strength in (2.0, 0.002)
    )
    assert stiff < 0.5 * soft


@pytest.mark.parametrize("blend", [0.1, 0.36])
def test_a_contact_sets_in_twice_the_blend_before_it(blend):
    """Until then the arms move as in the rotation copy. The hands meet in frame 100, and come near just before."""
    frame_time, meet = 0.02, 100
    source = clapping(np.clip((np.arange(150) - meet + 8) / 8, 0.0, 1.0), str(frame_time))
    settings = replace(DEFAULT, blend=blend, foot_lock=0.0)
    result = retarget(source, lengthened(person(), {"Wrist": 1.5}), BONES_ALONE, settings=settings)
    off = np.abs(result.motion.positions - result.rotation_copy.positions).max(axis=(1, 2)) > 1e-6
    assert np.argmax(off) * frame_time == pytest.approx(meet * frame_time - 2 * blend, abs=0.1)

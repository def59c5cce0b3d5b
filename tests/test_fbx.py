"""FBX files as input: transforms against FBX's own rule, skins, animations and their frames, and bad files."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fbx_text import Y_UP, Z_UP, Node, Stack, fbx
from scipy.spatial.transform import Rotation

from distretarget.batch.audit import audit
from distretarget.batch.plan import animations_of
from distretarget.errors import FileError, MissingPackageError
from distretarget.io import fbx as reader
from distretarget.io.fbx import parse_fbx
from distretarget.io.input_file import InputFile
from distretarget.io.reading import parse_target

pytest.importorskip("ufbx", reason="the package ufbx reads FBX")

ORDERS = ("xyz", "xzy", "yzx", "yxz", "zxy", "zyx")  # FBX's orders of rotation, 0 to 5, about fixed axes
CHARACTERS = Path(__file__).resolve().parents[2] / "shared" / "characters"
TIMES = np.arange(8) / 30


def shift(vector):
    matrix = np.eye(4)
    matrix[:3, 3] = vector
    return matrix


def turn(angles, order="xyz"):
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_euler(
        order, [angles["XYZ".index(axis.upper())] for axis in order], degrees=True
    ).as_matrix()
    return matrix


def local_of(node, R=None):
    """A node's matrix as the FBX SDK defines it: T Roff Rp Rpre R Rpost^-1 Rp^-1 Soff Sp S Sp^-1."""
    idle = node.properties.get("RotationActive") == 0 or node.properties.get("RotationSpaceForLimitOnly")
    ignored = ("PreRotation", "PostRotation") if idle else ()
    names = ("PreRotation", "PostRotation", "RotationOffset", "RotationPivot", "ScalingOffset", "ScalingPivot")
    values = [
        np.zeros(3) if name in ignored else np.array(node.properties.get(name, (0.0, 0.0, 0.0))) for name in names
    ]
    before, after, offset, pivot, scaling_offset, scaling_pivot = values
    rotation = turn(before) @ turn(node.R if R is None else R, ORDERS[node.properties.get("RotationOrder", 0)])
    rotation = shift(pivot) @ rotation @ np.linalg.inv(turn(after)) @ shift(-pivot)
    scaling = shift(scaling_pivot) @ np.diag([*node.S, 1.0]) @ shift(-scaling_pivot)
    return shift(node.T) @ shift(offset) @ rotation @ shift(scaling_offset) @ scaling


def worlds(scene, frame=None):
    """The world matrices of all nodes as shown, or in a frame of the animation, by name."""
    nodes, animation = scene.nodes, scene.animation
    parts = {"translations": nodes.translations, "rotations": nodes.rotations, "scales": nodes.scales}
    if frame is not None:
        parts = {
            kind: np.array(
                [
                    getattr(animation, kind)[n][frame] if n in getattr(animation, kind) else rest
                    for n, rest in enumerate(values)
                ]
            )
            for kind, values in parts.items()
        }
    return dict(zip(nodes.names, replace(nodes, **parts).world, strict=True))


def chain(properties):
    """Three bones, the one in the middle with these properties."""
    return [
        Node("Hips", T=(1.0, 90.0, 2.0), R=(10.0, 20.0, 30.0)),
        Node("Knee", 0, T=(5.0, -40.0, 1.0), R=(40.0, -20.0, 15.0), properties=properties),
        Node("Foot", 1, T=(2.0, -35.0, 4.0)),
    ]


@pytest.mark.parametrize(
    "properties",
    [
        *({"RotationOrder": order} for order in range(6)),
        {"PreRotation": (30.0, -70.0, 20.0), "PostRotation": (5.0, 60.0, -15.0), "RotationOrder": 4},
        {"PreRotation": (30.0, -70.0, 20.0), "PostRotation": (5.0, 60.0, -15.0), "RotationActive": 0},
        {"PreRotation": (30.0, -70.0, 20.0), "RotationPivot": (3.0, -2.0, 7.0), "RotationSpaceForLimitOnly": 1},
        {"RotationOffset": (1.0, 2.0, 3.0), "PreRotation": (0.0, 90.0, 0.0)},
        {"RotationPivot": (3.0, -2.0, 7.0), "ScalingPivot": (3.0, -2.0, 7.0)},
        {"RotationPivot": (3.0, -2.0, 7.0), "ScalingPivot": (1.0, 1.0, 1.0), "ScalingOffset": (0.5, 0.0, 0.0)},
    ],
    ids=str,
)
def test_transforms_are_those_of_fbx(properties):
    nodes = chain(properties)
    keys = {(1, "R", axis): (TIMES, angle + 100.0 * TIMES) for axis, angle in zip("XYZ", nodes[1].R, strict=True)}
    scene = parse_fbx(fbx(nodes, [Stack("walk", keys)]), "a.fbx")
    pivot = shift(properties.get("RotationPivot", (0.0, 0.0, 0.0)))
    for frame in (None, *range(len(TIMES))):
        found = worlds(scene, frame)
        angles = nodes[1].R if frame is None else np.array(nodes[1].R) + 100.0 * TIMES[frame]
        knee = local_of(nodes[0]) @ local_of(nodes[1], angles)
        np.testing.assert_allclose(found["Foot"], knee @ local_of(nodes[2]), atol=1e-4)
        if "ScalingOffset" not in properties:
            np.testing.assert_allclose(found["Knee"], knee @ pivot, atol=1e-4)


def test_the_skin_is_where_it_was_bound():
    """The vertex at the origin of the world, whatever the pivots of the joints that move it and the pose shown."""
    nodes = chain({"RotationPivot": (3.0, -2.0, 7.0), "ScalingPivot": (3.0, -2.0, 7.0)})
    bind = local_of(nodes[0]) @ local_of(nodes[1])
    below = bind @ shift((0.0, -40.0, 3.0)) @ turn((5.0, 0.0, 30.0))
    target = parse_target(InputFile(fbx(nodes, skin={1: bind, 2: below}), "a.fbx"))
    mesh = target.mesh()
    np.testing.assert_allclose(mesh.vertices + target.skeleton.offsets[0], [[0.0, 0.0, 0.0]], atol=1e-4)
    assert {target.skeleton.names[joint] for joint in mesh.joints[0]} == {"Knee", "Foot"}


def test_a_file_without_a_mesh_is_not_read_for_one(monkeypatch):
    target = parse_target(InputFile(fbx(chain({})), "a.fbx"))
    monkeypatch.setattr(reader, "_read", None)
    assert target.mesh() is None


def test_a_mesh_that_cannot_be_read_is_a_warning(monkeypatch):
    bind = {1: shift((0.0, 50.0, 0.0)), 2: shift((0.0, 10.0, 0.0))}
    target = parse_target(InputFile(fbx(chain({}), skin=bind), "a.fbx"))
    monkeypatch.setattr(reader, "COMMAND", (sys.executable, "-c", "import os; os.abort()"))
    assert target.mesh() is None
    assert "the FBX reader stopped" in target.mesh.warnings[0]


def test_bones_that_do_not_inherit_scale():
    """Maya's segment scale compensate: a bone moves away from a parent that grows, but does not grow itself."""
    nodes = chain({"InheritType": 2})
    nodes[0].S = (2.0, 2.0, 2.0)
    keys = {(0, "S", axis): (TIMES, 2.0 + TIMES) for axis in "XYZ"}
    scene = parse_fbx(fbx(nodes, [Stack("grows", keys)]), "a.fbx")
    for frame, scale in ((None, 2.0), *((frame, 2.0 + time) for frame, time in enumerate(TIMES))):
        turned = turn(nodes[0].R)
        knee = shift(nodes[0].T) @ turned @ shift(scale * np.array(nodes[1].T)) @ turn(nodes[1].R)
        found = worlds(scene, frame)
        np.testing.assert_allclose(found["Knee"][:3, 3], knee[:3, 3], atol=1e-4)
        np.testing.assert_allclose(found["Foot"][:3, 3], (knee @ shift(nodes[2].T))[:3, 3], atol=1e-4)


@pytest.mark.parametrize(
    ("settings", "units", "up"),
    [
        ({"UnitScaleFactor": 1.0, **Y_UP}, "cm", "Y"),
        ({"UnitScaleFactor": 100.0, **Z_UP}, "m", "Z"),
        ({"UnitScaleFactor": 2.54, **Z_UP, "UpAxisSign": -1}, "in", "-Z"),
        ({"UnitScaleFactor": 3.0, "UpAxis": 0, "UpAxisSign": 1}, None, "X"),
        ({}, None, None),
    ],
)
def test_units_and_axes_are_the_files_own(settings, units, up):
    scene = parse_fbx(fbx(chain({}), settings=settings), "a.fbx")
    assert (scene.units, scene.up) == (units, up)
    assert scene.nodes.translations[0].tolist() == [1.0, 90.0, 2.0]


def test_bones_are_bound_as_in_the_skin_or_the_bind_pose_or_as_shown():
    nodes = [Node("Null", kind="Null"), *chain({}), Node("Prop", kind="LimbNode")]
    for node in nodes[1:4]:
        node.parent += 1
    bind = {1: shift((0.0, 90.0, 0.0)) @ turn((0.0, 0.0, 90.0)), 2: shift((0.0, 50.0, 0.0))}
    skinned = parse_fbx(fbx(nodes, skin=bind, pose=bind), "a.fbx")
    posed = parse_fbx(fbx(nodes, pose=bind), "a.fbx")
    shown = parse_fbx(fbx(nodes), "a.fbx")
    name = lambda scene: [[scene.nodes.names[joint] for joint in skin.joints] for skin in scene.skins]  # noqa: E731
    assert name(skinned) == [["Hips", "Knee"]]
    assert sorted(name(posed)) == sorted(name(shown)) == [["Hips", "Knee", "Foot"], ["Prop"]]
    for scene in (skinned, posed):
        (skin,) = (skin for skin in scene.skins if scene.nodes.names[skin.joints[0]] == "Hips")
        for inverse, matrix in zip(skin.inverse_binds, bind.values(), strict=False):
            np.testing.assert_allclose(np.linalg.inv(inverse), matrix, atol=1e-6)
    assert not posed.skins[name(posed).index(["Hips", "Knee", "Foot"])].inverse_binds[2].any()
    assert all(skin.inverse_binds is None for skin in shown.skins)


def of_keys(times, **options):
    curves = {(1, "R", "X"): (times, 20.0 * np.array(times))}
    return parse_fbx(fbx(chain({}), [Stack("walk", curves, **options)]), "a.fbx").animation


@pytest.mark.parametrize(
    ("times", "frames", "step"),
    [
        (np.arange(11) / 30, 11, "0.0333333333"),
        (np.arange(21) / 60, 21, "0.0166666667"),
        (np.round(np.arange(40) / 24, 3), 40, "0.0416666667"),  # rounded to milliseconds
        (np.arange(200) * 1.001 / 30, 200, "0.0333666667"),
        ([0.0, 1.0, 2.0], 61, "0.0333333333"),  # poses of an animator: the file's 30 frames/s
        ([0.0, 5 / 30, 9 / 30], 10, "0.0333333333"),
        ([0.5, 0.5 + 3 / 24, 0.5 + 4 / 24], 5, "0.0416666667"),
        (np.delete(np.arange(60) / 120, [7, 8, 20]), 60, "0.00833333333"),
        ([0.7], 1, "0.0333333333"),
    ],
)
def test_frames_are_the_animations_own_keys_or_the_files_frames(times, frames, step):
    animation = of_keys(times)
    assert (animation.frames, animation.frame_time_text) == (frames, step)
    angles = Rotation.from_quat(animation.rotations[1]).as_euler("ZYX", degrees=True)[:, 2]
    at = times[0] + float(step) * np.arange(frames)
    np.testing.assert_allclose(angles, 20.0 * at, atol=0.05)


def test_fps_asks_for_another_frame_rate():
    content = fbx(chain({}), [Stack("walk", {(1, "R", "X"): ([0.0, 1.0], [0.0, 60.0])})])
    animation = parse_fbx(content, "a.fbx", fps=12.0).animation
    assert (animation.frames, animation.frame_time_text) == (13, "0.0833333333")
    assert not animation.translations
    assert not animation.scales
    assert list(animation.rotations) == [1]


def test_only_the_time_span_of_the_animation_counts():
    assert of_keys(np.arange(31) / 30, span=(10 / 30, 20 / 30)).frames == 11
    assert of_keys(np.arange(31) / 30, span=(50.0, 60.0)).frames == 31
    assert of_keys(np.arange(31) / 30, span=(0.0, 0.0)).frames == 31


def test_an_animation_is_chosen_by_name_and_those_without_keys_do_not_count():
    walk, run = (Stack(name, {(1, "R", "X"): (TIMES, n * TIMES)}) for n, name in enumerate(("walk", "run"), start=1))
    content = fbx(chain({}), [walk, run, Stack("Take 001")])
    scene = parse_fbx(content, "a.fbx", clip="run")
    assert scene.animations == ("walk", "run")
    assert scene.animation.name == "run"
    with pytest.raises(FileError, match=r"^a\.fbx: has 2 animations: 'walk', 'run'; choose one with --clip"):
        parse_fbx(content, "a.fbx")
    with pytest.raises(FileError, match="has no animation 'rum'; did you mean 'run'"):
        parse_fbx(content, "a.fbx", clip="rum")
    assert parse_fbx(content, "a.fbx", with_animation=False).animation is None
    assert parse_fbx(fbx(chain({}), [Stack("Take 001")]), "a.fbx").animation is None


def test_an_animation_that_is_too_long_is_one_line():
    with pytest.raises(
        FileError, match=r"^a\.fbx: the animation 'walk' would have \d+ frames; ask for fewer with --fps"
    ):
        of_keys([0.0, 1e9], span=(0.0, 2e9))


def test_names_are_kept():
    nodes = [Node("mixamorig:Hips"), Node("Left Leg/ä", 0), Node("", 0), Node("Left Leg/ä", 0)]
    assert sorted(parse_fbx(fbx(nodes), "a.fbx").nodes.names) == sorted(node.name for node in nodes)


CONTENT = fbx(chain({}), [Stack("walk", {(1, "R", "X"): (TIMES, TIMES)})])
FAULTS = {
    "empty": b"",
    "text": b"no FBX",
    "cut header": b"Kaydara FBX Binary  \x00\x1a\x00" + bytes([232, 28, 0, 0, 99]),
    "cut text": CONTENT[: len(CONTENT) // 2],
    "nan": CONTENT.replace(b"90.0", b"nan"),
    "huge": CONTENT.replace(b"90.0", b"1e200"),
    "infinite": CONTENT.replace(b"90.0", b"1e999"),
}


@pytest.mark.parametrize("content", FAULTS.values(), ids=FAULTS)
def test_a_bad_file_is_one_line(content):
    with pytest.raises(FileError, match=r"^bad\.fbx: [^\n]*$"):
        parse_fbx(content, "bad.fbx")


KILLED = "import os, signal; os.kill(os.getpid(), getattr(signal, 'SIGSEGV'))"
STOPS = {
    KILLED: r"the FBX reader stopped \(segmentation fault\)",
    "import sys; sys.exit(3)": r"the FBX reader stopped \(exit status 3\)",
    "print('garbage')": "the FBX reader stopped",
    "pass": "the FBX reader stopped",
    "import time; time.sleep(60)": r"the FBX reader stopped \(no answer after 0 s\)",
}


@pytest.mark.parametrize("program", STOPS)
def test_a_reader_that_stops_is_one_line(monkeypatch, program):
    if program is KILLED and sys.platform == "win32":
        pytest.skip("a signal is a POSIX matter")
    monkeypatch.setattr(reader, "COMMAND", (sys.executable, "-c", program))
    monkeypatch.setattr(reader, "SECONDS", 0.2 if "sleep" in program else 60.0)
    with pytest.raises(
        FileError, match=f"^hero.fbx: {STOPS[program]}.*; open the file in Blender and export it as GLB$"
    ):
        parse_fbx(b"content", "hero.fbx")


def test_without_ufbx_a_line_says_what_to_install(monkeypatch):
    monkeypatch.setattr(reader.importlib.util, "find_spec", lambda _name: None)
    with pytest.raises(MissingPackageError, match=r"^a\.fbx: .*pip install 'distretarget\[fbx\]'"):
        parse_fbx(b"", "a.fbx")


def test_the_reader_does_not_import_from_the_current_folder(monkeypatch, tmp_path):
    (tmp_path / "ufbx.py").write_text("raise SystemExit(5)")
    monkeypatch.delenv("PYTHONPATH", raising=False)
    monkeypatch.chdir(tmp_path)
    assert len(parse_fbx(fbx(chain({})), "a.fbx").nodes) == 3


@pytest.mark.parametrize("name", ["cmu_91_48.fbx", "cmu_91_54.fbx"])
def test_mocap_exported_by_blender(name):
    path = CHARACTERS / name
    if not path.is_file():
        pytest.skip("the folder of characters is absent")
    scene = parse_fbx(path.read_bytes(), name)
    assert (scene.units, scene.up, len(scene.skins), len(scene.skins[0].joints)) == ("cm", "Y", 1, 43)
    assert scene.animation.frame_time_text == "0.0333333333"
    for frame in (0, 50):
        world = worlds(scene, frame)
        assert world["head"][1, 3] > world["hip"][1, 3] > world["lFoot"][1, 3]


VERSION_6100 = """; FBX 6.1.0 project file
FBXHeaderExtension:  { FBXHeaderVersion: 1003
    FBXVersion: 6100 }
Objects:  {
    Model: "Model::Hips", "Limb" { Version: 232
        Properties60:  {
            Property: "Lcl Translation", "Lcl Translation", "A+",0,90,0
            Property: "Lcl Rotation", "Lcl Rotation", "A+",0,0,0
        } }
    Model: "Model::Knee", "Limb" { Version: 232
        Properties60:  { Property: "Lcl Translation", "Lcl Translation", "A+",0,-40,0 } }
    GlobalSettings:  { Version: 1000
        Properties60:  {
            Property: "UpAxis", "int", "",1
            Property: "UpAxisSign", "int", "",1
            Property: "UnitScaleFactor", "double", "",1
        } }
}
Connections:  {
    Connect: "OO", "Model::Hips", "Model::Scene"
    Connect: "OO", "Model::Knee", "Model::Hips"
}
Takes:  { Current: "walk"
    Take: "walk" { FileName: "walk.tak"
        LocalTime: 0,4618615800
        ReferenceTime: 0,4618615800
        Model: "Model::Hips" { Version: 1.1
            Channel: "Transform" { Channel: "R" { Channel: "Z" { Default: 0
                KeyVer: 4005
                KeyCount: 4
                Key: 0,0,L,1539538600,10,L,3079077200,20,L,4618615800,30,L
            } } }
        }
    }
}
"""


def test_a_file_of_version_6100():
    scene = parse_fbx(VERSION_6100.encode(), "old.fbx")
    assert (scene.nodes.names, scene.units, scene.up) == (("Hips", "Knee"), "cm", "Y")
    assert (scene.animation.name, scene.animation.frames, scene.animation.frame_time_text) == (
        "walk",
        4,
        "0.0333333333",
    )
    expected = (shift((0.0, 90.0, 0.0)) @ turn((0.0, 0.0, 30.0)) @ shift((0.0, -40.0, 0.0)))[:3, 3]
    np.testing.assert_allclose(worlds(scene, 3)["Knee"][:3, 3], expected, atol=1e-4)


def test_each_animation_of_a_file_is_a_clip_of_a_folder(tmp_path):
    walk, run = (Stack(name, {(1, "R", "X"): (TIMES, n * TIMES)}) for n, name in enumerate(("walk", "run"), start=1))
    (tmp_path / "two.fbx").write_bytes(fbx(chain({}), [walk, run]))
    (tmp_path / "one.fbx").write_bytes(fbx(chain({}), [walk]))
    assert animations_of(tmp_path / "two.fbx") == {"#1": "walk", "#2": "run"}
    assert animations_of(tmp_path / "one.fbx") == {None: ""}
    audited = audit(sorted(tmp_path.glob("*.fbx")))
    assert [(clip.path.stem, clip.animation) for clip in audited] == [("one", None), ("two", "#1"), ("two", "#2")]
    assert all(clip.frames == len(TIMES) for clip in audited)

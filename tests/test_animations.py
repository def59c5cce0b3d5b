"""Animations: values between keys, frames at keys, and several in one file, none of which depends on another."""

import copy
import json

import gltf_player
import numpy as np
import pytest
from bodies import sample
from characters import ARMATURE, Bones, Performance, character, chunks
from gltf_file import glb
from scipy.spatial.transform import Rotation

from distretarget import Motion, load_target, write_motion
from distretarget.character.animations import own_rate
from distretarget.character.nodes import Animation, Curve, sampled
from distretarget.errors import FileError
from distretarget.io import gltf_writer
from distretarget.io.gltf import parse_gltf
from distretarget.io.gltf_writer import animated


def float32(times):
    return np.float32(times).astype(float)


@pytest.mark.parametrize("rate", [10.0, 24.0, 29.97, 30.0, 59.94, 60 / 1.00002, 60.0, 120.0])
@pytest.mark.parametrize(("frames", "start"), [(2, 0.0), (50, 1 / 24), (10_000, 0.0), (10_000, 100.0)])
def test_frames_are_keys(rate, frames, start):
    times = float32(start + np.arange(frames) / rate)
    curve = Curve(times, np.arange(frames, dtype=float)[:, None, None] * [1.0, 0, 0], "LINEAR")
    animation = sampled("a.glb", "walk", {"translation": {5: curve}, "rotation": {}, "scale": {}}, None, 10**6)
    assert animation.frames == frames
    assert animation.translations[5][:, 0] == pytest.approx(np.arange(frames), abs=1e-9)
    assert float(animation.frame_time_text) == pytest.approx(1 / rate, rel=2e-2 / frames + 1e-6)


def test_rates_of_few_keys_and_of_keys_far_apart():
    assert own_rate(np.array([0.0])) == 30.0
    assert own_rate(np.array([0.0, 1.0, 2.0])) == 24.0
    assert own_rate(np.array([0.0, 0.1, 0.3, 0.7])) == pytest.approx(10.0)
    assert own_rate(np.array([0.0, 0.5, 0.7])) == 30.0
    assert own_rate(np.array([0.0, 0.013, 0.5, 0.7])) == 60.0
    curve = Curve(np.array([0.0, 1e9]), np.zeros((2, 1, 3)), "LINEAR")
    with pytest.raises(FileError, match="is 1e\\+09 s long; at 100 frames/s that is too much"):
        sampled("a.glb", "walk", {"translation": {0: curve}, "rotation": {}, "scale": {}}, 100.0, 10**6)
    times, places = 1000.0 * np.arange(50), np.arange(150.0).reshape(50, 1, 3)
    curves = {"translation": {0: Curve(times, places, "LINEAR")}, "rotation": {}, "scale": {}}
    found = sampled("a.glb", "walk", curves, None, 10**6)
    assert (found.frames, found.frame_time_text) == (50, "1000")
    np.testing.assert_array_equal(found.translations[0], places[:, 0])


TIMES = np.array([1.0, 2.0, 4.0])


def curve(values, interpolation="LINEAR"):
    keys = np.asarray(values, float)
    return Curve(TIMES, keys if keys.ndim == 3 else keys[:, None], interpolation)


def about_z(degrees):
    return Rotation.from_euler("Z", degrees, degrees=True).as_quat()


def test_a_step_holds_a_key_until_the_next():
    steps = curve([[1.0], [2.0], [3.0]], "STEP")
    at = steps.at(np.array([0.0, 1.0, 1.9, 2.0, 3.999, 4.0, 9.0]), rotates=False)
    assert at[:, 0].tolist() == [1.0, 1.0, 1.0, 2.0, 2.0, 3.0, 3.0]
    at = curve([[0.0], [1.0], [5.0]]).at(np.array([0.0, 1.25, 2.0, 3.5, 4.0, 7.0]), rotates=False)
    np.testing.assert_allclose(at[:, 0], [0.0, 0.25, 1.0, 4.0, 5.0, 5.0])


def test_rotations_turn_the_shorter_way_evenly():
    opposite = curve([about_z(0), -about_z(90), about_z(150)])
    at = opposite.at(np.array([1.0, 1.5, 2.5, 3.0]), rotates=True)
    angles = Rotation.from_quat(at).as_euler("ZYX", degrees=True)[:, 0]
    np.testing.assert_allclose(angles, [0.0, 45.0, 105.0, 120.0], atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(at, axis=1), 1.0)


def test_splines_are_hermites_with_the_tangents_out_and_in():
    """Halfway between p and q, after d seconds: (p + q) / 2 + d (out - in) / 8."""
    keys = [[[9.0], [1.0], [2.0]], [[-3.0], [4.0], [5.0]], [[7.0], [0.0], [9.0]]]
    at = curve(keys, "CUBICSPLINE").at(np.array([1.0, 1.5, 2.0, 3.0]), rotates=False)
    np.testing.assert_allclose(at[:, 0], [1.0, 2.5 + (2.0 + 3.0) / 8, 4.0, 2.0 + 2.0 * (5.0 - 7.0) / 8])
    none = np.zeros(4)
    keys = [[none, about_z(0), none], [none, about_z(90), none], [none, -about_z(90), none]]
    at = curve(keys, "CUBICSPLINE").at(np.array([1.5, 3.0]), rotates=True)
    np.testing.assert_allclose(np.linalg.norm(at, axis=1), 1.0)
    np.testing.assert_allclose(at[0], about_z(45), atol=1e-9)
    np.testing.assert_allclose(at[1], about_z(90), atol=1e-9)  # the spline is zero there


@pytest.mark.parametrize("interpolation", ["STEP", "LINEAR"])
def test_a_single_key_holds_for_ever(interpolation):
    one = Curve(np.array([1.0]), np.array([[[2.0]]]), interpolation)
    assert one.at(np.array([0.0, 1.0, 5.0]), rotates=False)[:, 0].tolist() == [2.0, 2.0, 2.0]


BONES = Bones.of(sample("walk").skeleton)
SWAY = Performance.swaying(BONES, 5)


def still(path):
    """A motion of a character of which only the root turns."""
    skeleton = load_target(path).character.skeleton
    rotations = np.tile([0.0, 0.0, 0.0, 1.0], (3, len(skeleton), 1))
    rotations[1:, 0] = [0.0, np.sin(0.2), 0.0, np.cos(0.2)]
    return Motion(skeleton, np.tile(skeleton.offsets[0], (3, 1)), rotations, "0.1")


def after_another(document, buffer, another):
    """The document whose nodes show what another animation leaves them with."""
    left, entry = copy.deepcopy(document), document["animations"][another]
    for channel in entry["channels"]:
        output = gltf_player.values(document, buffer, entry["samplers"][channel["sampler"]]["output"])
        left["nodes"][channel["target"]["node"]][channel["target"]["path"]] = output[-1].tolist()
    return left


@pytest.mark.parametrize("above", [None, ARMATURE], ids=["plain", "armature"])
def test_an_animation_looks_the_same_after_another(above, tmp_path):
    made = character(BONES, axes=BONES.along_bones(0.5), above=above)
    made.animate("sway", SWAY, all_translations=True, scales=True)
    path = made.write(tmp_path / "hero.glb")
    write_motion(tmp_path / "still.glb", still(path), path)
    document, buffer = chunks((tmp_path / "still.glb").read_bytes())
    times = [0.0, 0.1, 0.2]
    alone = gltf_player.worlds(document, buffer, "still", times)
    after = gltf_player.worlds(after_another(document, buffer, 0), buffer, "still", times)
    assert after == pytest.approx(alone, abs=1e-6)


def test_what_no_animation_moves_has_no_keys(tmp_path):
    made = character(BONES)
    made.animate("sway", SWAY)
    path = made.write(tmp_path / "hero.glb")
    write_motion(tmp_path / "still.glb", still(path), path, animations="replace")
    document, _ = chunks((tmp_path / "still.glb").read_bytes())
    assert [channel["target"] for channel in document["animations"][0]["channels"]] == [
        {"node": made.joints[0], "path": "rotation"}
    ]


def animations_named(names, path, **options):
    """The content of a file with animations of these names, of which each turns the first joint."""
    turns = {0: np.tile([0.0, 0.0, 0.0, 1.0], (3, 1))}
    clips = [Animation(name, 3, "0.1", rotations=turns) for name in names]
    return b"".join(animated(parse_gltf(path.read_bytes(), path), clips, **options))


@pytest.mark.parametrize(
    ("mode", "given", "names"),
    [
        ("add", ["sway", "sway", "walk"], ["sway", "sway 2", "sway 3", "walk"]),
        ("replace", ["sway", "walk", "walk"], ["sway", "walk", "walk 2"]),
        ("add", ["walk", "walk 2", "walk"], ["sway", "walk", "walk 2", "walk 3"]),
    ],
)
def test_names_that_are_taken_get_the_first_free_number(mode, given, names, tmp_path):
    made = character(BONES)
    made.animate("sway", SWAY)
    document, _ = chunks(animations_named(given, made.write(tmp_path / "hero.glb"), mode=mode))
    assert [each["name"] for each in document["animations"]] == names


def test_a_glb_of_more_than_four_gigabytes_is_refused(tmp_path, monkeypatch):
    path = character(BONES).write(tmp_path / "hero.glb")
    size = len(animations_named(["walk"], path))
    monkeypatch.setattr(gltf_writer, "LARGEST_GLB", size)
    assert len(animations_named(["walk"], path)) == size
    monkeypatch.setattr(gltf_writer, "LARGEST_GLB", size - 1)
    with pytest.raises(FileError, match="it would be larger than 4 GB"):
        animations_named(["walk"], path)


@pytest.mark.parametrize("more", [0, 1, 2, 3])
def test_new_numbers_are_on_a_multiple_of_four_whatever_the_file_holds(more, tmp_path):
    path = character(BONES).write(tmp_path / "hero.glb")
    document, buffer = chunks(path.read_bytes())
    buffer += bytes(more)  # some programs do not fill the binary chunk up
    document["buffers"] = [{"byteLength": len(buffer)}]
    path.write_bytes(glb(json.dumps(document).encode(), buffer))
    written, binary = chunks(animations_named(["walk"], path))
    assert all(view["byteOffset"] % 4 == 0 for view in written["bufferViews"])
    assert len(binary) % 4 == 0
    (sampler,) = written["animations"][0]["samplers"]
    np.testing.assert_allclose(gltf_player.values(written, binary, sampler["input"]).ravel(), [0.0, 0.1, 0.2])
    np.testing.assert_array_equal(gltf_player.values(written, binary, sampler["output"]), [[0.0, 0.0, 0.0, 1.0]] * 3)


def test_animations_added_one_after_the_other_have_keys_for_what_any_of_them_moves(tmp_path):
    made = character(BONES)
    made.animate("sway", SWAY)
    path = made.write(tmp_path / "hero.glb")
    turns, posed = np.tile([0.0, 0.0, 0.6, 0.8], (3, 1)), frozenset(made.joints)
    one, other = (
        Animation(name, 3, "0.1", rotations={made.joints[joint]: turns}, posed=posed)
        for name, joint in (("one", 1), ("other", 2))
    )

    def content(before, animations, **options):
        return b"".join(animated(parse_gltf(before, path), animations, **options))

    def keyed(content):
        entries = chunks(content)[0]["animations"]
        targets = [{(each["target"]["path"], each["target"]["node"]) for each in one["channels"]} for one in entries]
        return [each["name"] for each in entries], targets

    together = keyed(content(path.read_bytes(), [one, other]))
    assert keyed(content(content(path.read_bytes(), [one]), [other], own=1)) == together
    names, (own, *added) = together
    assert names == ["sway", "one", "other"]
    assert added == [own | {("rotation", made.joints[joint]) for joint in (1, 2)}] * 2

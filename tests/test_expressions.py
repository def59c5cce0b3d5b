"""Expressions: weights of morph targets that go from an animation to a character, as a plain reader finds them."""

import gltf_player
import numpy as np
import pytest
from characters import as_vrm0, as_vrm1, as_vrma, character
from program import succeeded
from test_characters import BONES, WALK

from distretarget.io.gltf import parse_gltf
from distretarget.io.gltf_scene import face_of

NEAR = 1e-4  # frames are a little off the keys, as files state times in single precision
TIMES = WALK.times
OPEN, SMILE = np.linspace(0, 1, len(TIMES)), np.linspace(0, 0.6, len(TIMES)) ** 2


def with_face(made, names, shown=None, mesh=0):
    """A character with morph targets of these names, and the weights that its mesh shows."""
    entry = made.document["meshes"][mesh]
    count = made.document["accessors"][entry["primitives"][0]["attributes"]["POSITION"]]["count"]
    still = made.accessor(np.zeros((count, 3)), bounds=True)
    entry["primitives"][0]["targets"] = [{"POSITION": still} for _ in names]
    entry["extras"] = {"targetNames": list(names)}
    if shown is not None:
        entry["weights"] = list(shown)
    return made


def talking(names, weights, interpolation="LINEAR"):
    """A character that walks, and whose face moves: weights are (frames, names)."""
    made = with_face(character(BONES), names)
    number = made.animate("walk", WALK)
    animation = made.document["animations"][number]
    if interpolation == "CUBICSPLINE":
        weights = np.stack([0 * weights, weights, 0 * weights], axis=1)
    times = made.accessor(TIMES, bounds=True)
    output = made.accessor(np.asarray(weights).ravel())
    animation["samplers"].append({"input": times, "output": output, "interpolation": interpolation})
    target = {"node": node_of(made.document), "path": "weights"}
    animation["channels"].append({"sampler": len(animation["samplers"]) - 1, "target": target})
    return made


def node_of(document, mesh=0):
    return next(number for number, node in enumerate(document["nodes"]) if node.get("mesh") == mesh)


def weights_in(path, mesh=0, animation=0):
    """The times and the weights, (keys, targets), of a mesh in an animation of a file; None where it has none."""
    document, buffer = gltf_player.load(path)
    entry = document["animations"][animation]
    for channel in entry["channels"]:
        if channel["target"] == {"node": node_of(document, mesh), "path": "weights"}:
            sampler = entry["samplers"][channel["sampler"]]
            times, keys = (gltf_player.values(document, buffer, sampler[each]) for each in ("input", "output"))
            return times, keys.reshape(len(times), -1)
    return None


def converted(tmp_path, source, target, *options, suffix="glb"):
    out = tmp_path / f"out.{suffix}"
    source, target = source.write(tmp_path / "source.glb"), target.write(tmp_path / f"target.{suffix}")
    return out, succeeded(source, target, "-o", out, *options).stderr


@pytest.mark.parametrize("interpolation", ["LINEAR", "CUBICSPLINE"])
def test_morph_targets_of_the_same_name_move_as_in_the_source(tmp_path, interpolation):
    source = talking(["jawOpen", "smile"], np.stack([OPEN, SMILE], axis=1), interpolation)
    target = with_face(character(BONES), ["blink", "Smile", "jawOpen"], [0.25, 0.5, 0.75])
    out, said = converted(tmp_path, source, target)
    times, keys = weights_in(out)
    assert times == pytest.approx(TIMES - TIMES[0], abs=NEAR)
    assert keys == pytest.approx(np.stack([np.full(len(TIMES), 0.25), SMILE, OPEN], axis=1), abs=NEAR)
    assert "left out" not in said


def test_what_the_target_lacks_is_said(tmp_path):
    source = talking(["jawOpen", "smile", "still"], np.stack([OPEN, SMILE, 0 * OPEN], axis=1))
    out, said = converted(tmp_path, source, with_face(character(BONES), ["jawOpen"]))
    assert weights_in(out)[1][:, 0] == pytest.approx(OPEN, abs=NEAR)
    assert "warning: expressions that the target lacks are left out: 'smile'\n" in said
    source = talking(["jawOpen"], OPEN[:, None]).write(tmp_path / "source.glb")
    target = with_face(character(BONES), ["jawOpen"]).write(tmp_path / "target.glb")
    said = succeeded(source, target, "-o", tmp_path / "out.bvh").stderr
    assert "moves morph targets or expressions, such as those of a face; they are left out" in said


def test_they_are_cut_out_and_sped_up_with_the_motion(tmp_path):
    target = with_face(character(BONES), ["jawOpen"])
    out, _ = converted(tmp_path, talking(["jawOpen"], OPEN[:, None]), target, "--start", "4f", "--speed", "2")
    times, keys = weights_in(out)
    expected = np.interp(TIMES[4] + 2.0 * times, TIMES, OPEN)
    assert len(times) == (len(TIMES) - 4 + 1) // 2
    assert keys[:, 0] == pytest.approx(expected, abs=NEAR)
    out, _ = converted(tmp_path, talking(["jawOpen"], OPEN[:, None]), target, "--loop", "--overwrite")
    keys = weights_in(out)[1][:, 0]
    steps = np.diff(np.append(keys, keys[0]))
    assert abs(steps[-1]) < 2 * np.abs(steps[:-1]).max() < 0.5


def test_an_expression_of_a_vrm_weighs_its_morph_targets(tmp_path):
    target = as_vrm1(with_face(character(BONES), ["mouth", "cheeks"]))
    binds = [{"node": node_of(target.document), "index": index, "weight": w} for index, w in ((0, 1.0), (1, 0.5))]
    target.document["extensions"]["VRMC_vrm"]["expressions"]["preset"]["happy"]["morphTargetBinds"] = binds
    out, _ = converted(tmp_path, talking(["Happy"], SMILE[:, None]), target, suffix="vrm")
    assert weights_in(out)[1] == pytest.approx(np.stack([SMILE, 0.5 * SMILE], axis=1), abs=NEAR)


def test_an_expression_of_a_vrm_animation_goes_to_a_vrm_0(tmp_path):
    source = as_vrma(character(BONES))
    number = source.animate("walk", WALK)
    node = source.node("happy", -1, np.eye(4))
    source.document["extensions"]["VRMC_vrm_animation"]["expressions"] = {"preset": {"happy": {"node": node}}}
    entry = source.document["animations"][number]
    moves = source.accessor(np.outer(SMILE, [1.0, 0.0, 0.0]))
    entry["samplers"].append({"input": source.accessor(TIMES, bounds=True), "output": moves})
    channel = {"sampler": len(entry["samplers"]) - 1, "target": {"node": node, "path": "translation"}}
    entry["channels"].append(channel)
    target = as_vrm0(with_face(character(BONES), ["fun"]))
    group = {"name": "Joy", "presetName": "joy", "binds": [{"mesh": 0, "index": 0, "weight": 80}]}
    target.document["extensions"]["VRM"]["blendShapeMaster"]["blendShapeGroups"] = [group]
    out, _ = converted(tmp_path, source, target, suffix="vrm")
    assert weights_in(out)[1][:, 0] == pytest.approx(0.8 * SMILE, abs=NEAR)


def test_a_folder_of_clips_keeps_the_expressions_of_each(tmp_path):
    folder = tmp_path / "clips"
    folder.mkdir()
    for name, weights in (("a", OPEN), ("b", SMILE)):
        talking(["jawOpen"], weights[:, None]).write(folder / f"{name}.glb")
    target = with_face(character(BONES), ["jawOpen"]).write(tmp_path / "target.glb")
    succeeded("batch", folder, target, "-o", tmp_path / "out", "--jobs", "2")
    assert weights_in(tmp_path / "out" / "a.glb")[1][:, 0] == pytest.approx(OPEN, abs=NEAR)
    assert weights_in(tmp_path / "out" / "b.glb")[1][:, 0] == pytest.approx(SMILE, abs=NEAR)


@pytest.mark.parametrize("names", [None, {"a": 1}, ["jawOpen", 3], ["jawOpen"] * 9])
def test_extras_that_are_no_names_are_as_good_as_none(names, tmp_path):
    source, target = talking(["jawOpen"], OPEN[:, None]), with_face(character(BONES), ["jawOpen"])
    source.document["meshes"][0]["extras"] = {"targetNames": names}
    target.document["meshes"][0]["extras"] = {"targetNames": names}
    out, _ = converted(tmp_path, source, target)
    assert weights_in(out) is None


@pytest.mark.parametrize("change", [{"primitives": []}, {"weights": [1.0]}, {"weights": "none"}])
def test_a_face_that_is_not_valid_is_as_good_as_none(change):
    made = with_face(character(BONES), ["jawOpen", "smile"])
    made.document["meshes"][0] |= change
    assert not face_of(parse_gltf(made.glb(), "made.glb")).targets

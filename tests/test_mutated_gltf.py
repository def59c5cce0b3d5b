"""Characters with faults that once ended in a traceback, took minutes or gigabytes, or were written wrong."""

import json
import sys
import warnings

import numpy as np
import pytest
from characters import Performance, as_vrm1, character, chunks, packed
from fuzz_characters import through
from fuzz_outcomes import REFUSED, RIGHT, outcome_of
from mutated_gltf import mutated
from test_bad_gltf import made, refused
from test_characters import BONES, WALK

from distretarget import DistretargetError, load_target, read_bvh, read_motion, write_bvh, write_motion

FEW_CALLS = 40.0  # of functions, for each byte of a file; what grows with the square of a file makes thousands

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning")


@pytest.mark.parametrize("seed", range(40))
def test_mutated_files_are_written_right_or_refused_in_one_line(seed):
    outcome, known = outcome_of(through, seed)
    assert outcome in (RIGHT, REFUSED), known


def test_seeds_make_the_same_files():
    assert mutated(7) == mutated(7) != mutated(8)


def saved(tmp_path, document, buffer=b"", name="hero.glb"):
    (tmp_path / name).write_bytes(packed(document, buffer))
    return tmp_path / name


def line_of_nodes(count, name, **more):
    """A document with a line of nodes, each the child of the one before."""
    nodes = [{"name": name, "translation": [0, 0.1, 0], "children": [n + 1]} for n in range(count - 1)]
    return {"asset": {"version": "2.0"}, "nodes": [*nodes, {"name": name}]} | more


def test_a_file_without_nodes(tmp_path):
    assert "has no skin" in refused(tmp_path, packed('{"asset": {"version": "2.0"}}'), load_target)


def test_names_that_are_too_long_for_a_line_are_cut(tmp_path):
    document, buffer = made()
    document["animations"] = [{"name": "x\n" * 10**5, "channels": [], "samplers": []}]
    assert len(refused(tmp_path, packed(document, buffer))) < 200
    document, buffer = chunks(as_vrm1(character(BONES)).glb())
    document["extensions"]["VRMC_vrm"]["humanoid"]["humanBones"]["k\n" * 10**5] = {"node": -1}
    line = refused(tmp_path, packed(document, buffer), load_target)
    assert len(line) < 300
    assert line.isprintable()


def test_the_name_of_a_joint_is_cut(tmp_path):
    document, buffer = made()
    document["nodes"][3]["name"] = "n" * 10**6
    assert max(map(len, load_target(saved(tmp_path, document, buffer)).skeleton.names)) == 200


@pytest.mark.parametrize("many", ["children", "joints", "channels", "samplers"])
def test_lists_that_are_too_long(many, tmp_path):
    document, buffer = made()
    holder = {"children": document["nodes"][0], "joints": document["skins"][0]}.get(many, document["animations"][0])
    holder[many] = [0] * 10**5
    assert f"{many}: expected at most 65536 entries, found 100000" in refused(tmp_path, packed(document, buffer))


@pytest.mark.parametrize("number", ["1" * 5000, "1e999", "NaN", "Infinity", "-Infinity"])
def test_a_number_elsewhere_in_the_file_that_other_readers_refuse_is_not_copied(tmp_path, number):
    document, buffer = made()
    text = json.dumps(document)[:-1] + ', "extras": {"number": ' + number + "}}"
    path = saved(tmp_path, text, buffer)
    motion = read_motion(path)
    with pytest.raises(DistretargetError, match=f"its JSON has the number {number[:40]}"):
        write_motion(tmp_path / "out.glb", motion, path)
    assert not (tmp_path / "out.glb").exists()


@pytest.mark.parametrize("depth", [900, 960, 970, 975, 980, 985, 990, 995])
def test_deep_nesting_elsewhere_in_the_file(depth, tmp_path):
    document, buffer = made()
    path = saved(tmp_path, json.dumps(document)[:-1] + ', "extras": ' + "[" * depth + "]" * depth + "}", buffer)
    motion = read_motion(saved(tmp_path, *made(), name="plain.glb"))
    try:
        write_motion(tmp_path / "out.glb", motion, path)
    except DistretargetError as error:
        assert "is nested too deeply" in str(error)  # noqa: PT017


@pytest.mark.parametrize("kept", [["translation"], ["translation", "rotation", "scale"]])
@pytest.mark.parametrize("first", [True, False])
def test_a_matrix_beside_the_transform_that_it_excludes(kept, first, tmp_path):
    hero = character(BONES, matrices=True)
    document, buffer = chunks(hero.glb())
    others = {"translation": [5, 5, 5], "rotation": [1, 0, 0, 0], "scale": [3, 3, 3]}
    for number in hero.joints:
        node = document["nodes"][number]
        added = {key: others[key] for key in kept}
        document["nodes"][number] = added | node if not first else {"matrix": node.pop("matrix")} | added | node
    path = saved(tmp_path, document, buffer)
    motion = read_motion(saved(tmp_path, *made(), name="plain.glb"))
    write_motion(tmp_path / "out.glb", motion, path, name="new")
    assert read_motion(tmp_path / "out.glb", clip="new").positions == pytest.approx(motion.positions, abs=1e-5)


def test_nodes_of_scale_0_are_not_hidden_to_the_skeleton(tmp_path):
    document, buffer = made()
    document["nodes"][4]["scale"] = [0, 0, 0]
    with pytest.warns(UserWarning, match=f"'{document['nodes'][4]['name']}' have the scale 0"):
        motion = read_motion(saved(tmp_path, document, buffer))
    assert motion.positions == pytest.approx(read_motion(saved(tmp_path, *made())).positions, abs=1e-5)


@pytest.mark.parametrize("size", [1e-11, 1e11])
def test_scales_that_cannot_be_computed_with(size, tmp_path):
    document, buffer = made()
    for number in (0, 1, 2):
        document["nodes"][number]["scale"] = [size] * 3
    assert "in the world is too extreme" in refused(tmp_path, packed(document, buffer), load_target)


def test_inverse_bind_matrices_with_a_last_row_of_zeros(tmp_path):
    document, buffer = made()
    accessor = document["accessors"][document["skins"][0]["inverseBindMatrices"]]
    view = document["bufferViews"][accessor["bufferView"]]
    at, count = view.get("byteOffset", 0), accessor["count"]
    matrices = np.frombuffer(buffer, "<f4", 16 * count, at).reshape(count, 4, 4).copy()
    matrices[:, :, 3] = 0.0  # columns come first
    changed = buffer[:at] + matrices.tobytes() + buffer[at + matrices.nbytes :]
    expected = load_target(saved(tmp_path, document, buffer)).skeleton.offsets
    assert load_target(saved(tmp_path, document, changed)).skeleton.offsets == pytest.approx(expected, abs=1e-6)


def test_a_spline_through_no_rotation_at_all(tmp_path):
    hero = character(BONES)
    turns = WALK.turns[:2].copy()
    turns[1] = -turns[0]
    hero.animate("walk", Performance(turns, WALK.positions[:2], np.array([0.0, 1.0])), "CUBICSPLINE")
    motion = read_motion(hero.write(tmp_path / "hero.glb"), fps=2)
    assert np.isfinite(motion.positions).all()


def test_bones_that_stretch_are_written_as_bvh(tmp_path):
    hero = character(BONES)
    stretched = Performance(WALK.turns, 1.2 * WALK.positions, WALK.times)
    hero.animate("walk", stretched, all_translations=True)
    motion = read_motion(hero.write(tmp_path / "hero.glb"))
    write_bvh(tmp_path / "out.bvh", motion)
    again = read_bvh(tmp_path / "out.bvh")
    assert again.positions == pytest.approx(motion.positions[:, list(motion.skeleton.depth_first)], abs=1e-5)


def test_a_chunk_without_the_length_of_its_buffer(tmp_path):
    motion = read_motion(saved(tmp_path, *made()))
    document, buffer = chunks(character(BONES).glb())
    del document["buffers"][0]["byteLength"]
    del document["skins"][0]["inverseBindMatrices"]
    path = saved(tmp_path, document, buffer)
    with pytest.raises(DistretargetError, match='has no "byteLength"'):
        write_motion(tmp_path / "out.glb", motion, path)
    assert not (tmp_path / "out.glb").exists()


def refused_soon(tmp_path, document, buffer=b"", read=load_target):
    """The line that a file gets after no more calls of functions than are few for each of its bytes."""
    content, calls = packed(document, buffer), 0

    def count(*_):
        nonlocal calls
        calls += 1

    sys.setprofile(count)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            line = refused(tmp_path, content, read)
    finally:
        sys.setprofile(None)
    assert calls < FEW_CALLS * len(content)
    return line


def test_long_lines_of_nodes(tmp_path):
    joints = list(range(10000))
    np.random.default_rng(0).shuffle(joints)
    document = line_of_nodes(10000, "a", skins=[{"joints": joints}])
    assert "10000 joints and 0 nodes above; expected at most" in refused_soon(tmp_path, document)
    document["nodes"][-1]["children"] = [9998]
    document["nodes"][9997]["children"] = []
    assert "nodes[9998].children: lead back to the node itself" in refused_soon(tmp_path, document)


def test_long_lines_of_joints_of_one_name(tmp_path):
    document = line_of_nodes(3000, "a", skins=[{"joints": list(range(3000))}])
    assert "too many joints have the same names: 'a'" in refused_soon(tmp_path, document)


def test_many_skins_of_single_nodes(tmp_path):
    nodes = [{"children": list(range(1, 8000))}, *({"translation": [0, 1, 0]} for _ in range(7999))]
    skins = [{"joints": [node]} for node in range(1, 8000)]
    document = {"asset": {"version": "2.0"}, "nodes": nodes, "skins": skins}
    assert "all bones have length 0" in refused_soon(tmp_path, document)


def test_many_channels_of_the_same_long_keys(tmp_path):
    keys = 100_000
    turns = np.tile([0, 0, 0, 1], (keys, 1)).astype("<f4").tobytes()
    times = np.arange(keys, dtype="<f4").tobytes()
    channels = [{"sampler": 0, "target": {"node": node, "path": "rotation"}} for node in range(10_000)]
    document = {
        "asset": {"version": "2.0"},
        "nodes": [{}] * 10_000,
        "buffers": [{"byteLength": len(times) + len(turns)}],
        "bufferViews": [
            {"buffer": 0, "byteLength": len(times)},
            {"buffer": 0, "byteOffset": len(times), "byteLength": len(turns)},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": keys, "type": "SCALAR"},
            {"bufferView": 1, "componentType": 5126, "count": keys, "type": "VEC4"},
        ],
        "animations": [{"samplers": [{"input": 0, "output": 1}], "channels": channels}],
    }
    line = refused_soon(tmp_path, document, times + turns, read_motion)
    assert "is referred to too often for a file of this size" in line


def test_two_keys_far_apart(tmp_path):
    hero = character(BONES)
    hero.animate("walk", Performance(WALK.turns[:2], WALK.positions[:2], np.array([0.0, 20_000.0])))
    document, buffer = chunks(hero.glb())
    assert "too" in refused_soon(tmp_path, document, buffer, read_motion)

"""Bad glTF files, also those that once ended in a traceback, minutes or gigabytes: one line, and nothing written."""

import json
import sys
import warnings

import numpy as np
import pytest
from bodies import SAMPLES
from characters import Performance, as_vrm1, character, chunks, packed
from fuzz_characters import through
from fuzz_outcomes import REFUSED, RIGHT, outcome_of
from program import run
from test_characters import BONES, WALK

from distretarget import DistretargetError, load_target, read_bvh, read_motion, write_bvh, write_motion


def made():
    hero = character(BONES)
    hero.animate("walk", WALK)
    return chunks(hero.glb())


def refused(tmp_path, content, read=read_motion, name="hero.glb"):
    """The line that a file gets, without its path."""
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(DistretargetError) as caught:
        read(path)
    line = str(caught.value)
    assert line.startswith(str(path))
    assert "\n" not in line
    assert len(line) - len(str(path)) < 400
    return line.removeprefix(str(path))


CONTENTS = {
    "empty": (b"", "is empty"),
    "a text": (b"walk", "is no glTF"),
    "cut header": (b"glTF\2\0\0\0", "is cut"),
    "glTF 1": (b"glTF\1\0\0\0\x14\0\0\0" + b"\0" * 8, "version 1"),
    "no JSON": (b"glTF\2\0\0\0\x14\0\0\0\0\0\0\0BIN\0", "not JSON"),
    "long chunk": (b"glTF\2\0\0\0\x14\0\0\0\xff\xff\xff\x7fJSON", "a chunk ends"),
    "bad JSON": (packed('{"asset": '), "is not valid JSON"),
    "bad UTF-8": (packed("{}").replace(b"{}", b"\xff\xfe"), "not valid UTF-8"),
    "a list": (packed("[]"), "expected an object, found a list"),
    "no asset": (packed("{}"), "asset.version: expected glTF 2.0"),
    "old asset": (packed('{"asset": {"version": "1.0"}}'), "asset.version: expected glTF 2.0, found '1.0'"),
    "nothing in it": (packed('{"asset": {"version": "2.0"}}'), "has no animation"),
    "deep": (packed('{"asset":' + "[" * 100000), "nested too deeply"),
}


@pytest.mark.parametrize("case", CONTENTS)
def test_files_that_are_no_gltf(tmp_path, case):
    content, expected = CONTENTS[case]
    assert expected in refused(tmp_path, content)


def change(*path_and_value):
    """What sets an entry of a document, or removes it if the value is None."""
    *path, last, value = path_and_value

    def apply(document):
        for key in path:
            document = document[key]
        if value is None:
            del document[last]
        else:
            document[last] = value

    return apply


def circle(document):
    """Let the left foot carry the left leg."""
    document["nodes"][0]["children"].remove(18)
    document["nodes"][21]["children"] = [18]


SAMPLER, CHANNEL = ("animations", 0, "samplers", 0), ("animations", 0, "channels", 0)
CHANGES = {
    "child that is not there": (
        change("nodes", 2, "children", [999]),
        "nodes[2].children[0]: expected an index of nodes",
    ),
    "child of two": (change("nodes", 2, "children", [1]), "is a child of nodes["),
    "circle": (circle, "nodes[18].children: lead back to the node itself"),
    "name that is a number": (change("nodes", 2, "name", 5), "nodes[2].name: expected a string, found 5"),
    "rotation of three": (change("nodes", 2, "rotation", [0, 0, 1]), "nodes[2].rotation: expected a list of 4"),
    "rotation of length 0": (change("nodes", 2, "rotation", [0, 0, 0, 0]), "nodes[2]: has a rotation of length 0"),
    "infinite translation": (
        change("nodes", 2, "translation", [0, 0, 1e400]),
        "nodes[2].translation[2]: expected a finite",
    ),
    "sheared matrix": (
        change("nodes", 2, "matrix", [1, 0, 0, 0, 0.5, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]),
        "nodes[2].matrix: shears 'Chest2': two of its axes are 63.4 degrees apart, not 90; apply",
    ),
    "matrix by rows": (
        change("nodes", 2, "matrix", [1, 0, 0, 0, 0, 1, 0, 0.25, 0, 0, 1, 0, 0, 0, 0, 1]),
        "nodes[2].matrix: gives 'Chest2' the last row 0 0.25 0 1, not 0 0 0 1; apply",
    ),
    "flat matrix": (change("nodes", 2, "matrix", [0] * 16), "nodes[2].matrix: has an axis of length 0"),
    "skin without joints": (change("skins", 0, "joints", []), "skins[0]: has no joints"),
    "joint that is not there": (change("skins", 0, "joints", 0, -1), "skins[0].joints[0]: expected an index of nodes"),
    "skin of none": (change("skins", None), "nodes[22].skin: there are no skins in the file"),
    "binds that are not there": (
        change("skins", 0, "inverseBindMatrices", 99),
        "skins[0].inverseBindMatrices: expected",
    ),
    "too few binds": (change("accessors", 3, "count", 2), "2 matrices for 22 joints"),
    "accessor out of its view": (change("accessors", 3, "count", 30), "accessors[3]: leads out of bufferViews[3]"),
    "accessor of another kind": (change("accessors", 3, "type", "VEC4"), "accessors[3]: expected type MAT4"),
    "a billion zeros": (change("accessors", 3, "count", 10**9), "no more numbers"),
    "view out of its buffer": (change("bufferViews", 3, "byteLength", 10**9), "bufferViews[3]: ends at byte"),
    "buffer cut": (change("buffers", 0, "byteLength", 10**9), "buffers[0]: has "),
    "buffer without content": (change("buffers", 0, "uri", "https://example.com/a.bin"), "buffers[0].uri: "),
    "component unknown": (change("accessors", 3, "componentType", 7), "accessors[3].componentType: expected one of"),
    "sampler unknown": (
        change(*CHANNEL, "sampler", 99),
        "animations[0].channels[0].sampler: expected an index of samplers",
    ),
    "keys that do not fit": (change(*SAMPLER, "interpolation", "CUBICSPLINE"), "animations[0].samplers[0].output: "),
    "interpolation unknown": (change(*SAMPLER, "interpolation", "BEZIER"), "animations[0].samplers[0].interpolation"),
    "channel without sampler": (change(*CHANNEL, "sampler", None), 'animations[0].channels[0]: has no "sampler"'),
    "no channels": (change("animations", 0, "channels", []), "nothing moves"),
    "compressed": (change("bufferViews", 3, "extensions", {"EXT_meshopt_compression": {}}), "compressed by meshopt"),
}


@pytest.mark.parametrize("case", CHANGES)
def test_faults_in_the_document(tmp_path, case):
    apply, expected = CHANGES[case]
    document, buffer = made()
    apply(document)
    assert expected in refused(tmp_path, packed(document, buffer))


@pytest.mark.parametrize(
    "uri", ["../hero.bin", "/etc/hostname", "https://example.com/a.bin", "file:a.bin", "a%2F..%2F..%2Fb", "c:\\a"]
)
def test_files_are_looked_for_in_the_folder_alone(tmp_path, uri):
    (tmp_path / "inner").mkdir()
    (tmp_path / "hero.bin").write_bytes(b"secret")
    document, _ = made()
    document["buffers"][0]["uri"] = uri
    assert "buffers[0].uri" in refused(tmp_path / "inner", json.dumps(document), name="hero.gltf")


def test_a_missing_buffer_is_named(tmp_path):
    document, _ = made()
    document["buffers"][0]["uri"] = "gone.bin"
    (tmp_path / "hero.gltf").write_text(json.dumps(document))
    with pytest.raises(DistretargetError, match=r"gone.bin: there is no such file"):
        read_motion(tmp_path / "hero.gltf")


def test_a_link_out_of_the_folder_is_not_followed(tmp_path):
    (tmp_path / "inner").mkdir()
    (tmp_path / "hero.bin").write_bytes(made()[1])
    (tmp_path / "inner" / "hero.bin").symlink_to(tmp_path / "hero.bin")
    document, _ = made()
    document["buffers"][0]["uri"] = "hero.bin"
    assert "leads out of the folder" in refused(tmp_path / "inner", json.dumps(document), name="hero.gltf")


def test_targets_without_a_body(tmp_path):
    document, buffer = made()
    del document["skins"]
    for node in document["nodes"]:
        node.pop("skin", None)
        node.pop("name")
    assert "has no skin" in refused(tmp_path, packed(document, buffer), load_target)
    assert "has no skin" in refused(tmp_path, packed('{"asset": {"version": "2.0"}}'), load_target)


def test_a_vrm_without_humanoid(tmp_path):
    hero = as_vrm1(character(BONES))
    document, buffer = chunks(hero.glb())
    document["extensions"]["VRMC_vrm"]["humanoid"] = {}
    content = packed(document, buffer)
    assert "extensions.VRMC_vrm: has no humanoid bones" in refused(tmp_path, content, load_target, "hero.vrm")


@pytest.mark.parametrize(("count", "expected"), [(10**5, "nodes: expected at most"), (10**6, "too large to read")])
def test_a_million_nodes(tmp_path, count, expected):
    text = '{"asset": {"version": "2.0"}, "nodes": [' + ",".join(['{"name": "a"}'] * count) + "]}"
    assert expected in refused(tmp_path, packed(text), load_target)


def test_an_animation_of_a_year(tmp_path):
    document, buffer = made()
    times = np.linspace(0, 3e7, document["accessors"][5]["count"]).astype("<f4").tobytes()
    start = document["bufferViews"][document["accessors"][5]["bufferView"]]["byteOffset"]
    content = packed(document, buffer[:start] + times + buffer[start + len(times) :])
    assert "that is too much" in refused(tmp_path, content)


def test_nothing_is_written_for_a_bad_character(tmp_path):
    document, buffer = made()
    document["skins"][0]["joints"][3] = 10**6
    (tmp_path / "hero.glb").write_bytes(packed(document, buffer))
    out = tmp_path / "out.glb"
    done = run(SAMPLES / "clap.bvh", tmp_path / "hero.glb", "-o", out)
    assert done.returncode == 1
    assert done.stderr.startswith(
        f"distretarget: {tmp_path / 'hero.glb'}: skins[0].joints[3]: expected an index of nodes"
    )
    assert done.stderr.count("\n") == 1
    assert not out.exists()


def test_lists_of_nothing(tmp_path):
    text = '{"asset": {"version": "2.0"}, "extras": [' + ",".join(["[]"] * (3 * 10**6)) + "]}"
    assert "lists and objects" in refused(tmp_path, packed(text), load_target)


FEW_CALLS = 40.0  # of functions, for each byte of a file; what grows with the square of a file makes thousands

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning")


@pytest.mark.parametrize("seed", range(24))
def test_mutated_files_are_written_right_or_refused_in_one_line(seed):
    outcome, known = outcome_of(through, seed)
    assert outcome in (RIGHT, REFUSED), known


def saved(tmp_path, document, buffer=b"", name="hero.glb"):
    (tmp_path / name).write_bytes(packed(document, buffer))
    return tmp_path / name


def line_of_nodes(count, name, **more):
    """A document with a line of nodes, each the child of the one before."""
    nodes = [{"name": name, "translation": [0, 0.1, 0], "children": [n + 1]} for n in range(count - 1)]
    return {"asset": {"version": "2.0"}, "nodes": [*nodes, {"name": name}]} | more


def test_names_that_are_too_long_for_a_line_are_cut(tmp_path):
    document, buffer = made()
    document["animations"] = [{"name": "x\n" * 10**5, "channels": [], "samplers": []}]
    assert len(refused(tmp_path, packed(document, buffer))) < 200
    document, buffer = chunks(as_vrm1(character(BONES)).glb())
    document["extensions"]["VRMC_vrm"]["humanoid"]["humanBones"]["k\n" * 10**5] = {"node": -1}
    line = refused(tmp_path, packed(document, buffer), load_target)
    assert len(line) < 300
    assert line.isprintable()
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
    document = line_of_nodes(3000, "a", skins=[{"joints": list(range(3000))}])
    assert "too many joints have the same names: 'a'" in refused_soon(tmp_path, document)


def test_many_skins_of_single_nodes(tmp_path):
    nodes = [{"children": list(range(1, 4000))}, *({"translation": [0, 1, 0]} for _ in range(3999))]
    skins = [{"joints": [node]} for node in range(1, 4000)]
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

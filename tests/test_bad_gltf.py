"""Bad glTF files: one line that says where the fault is, and nothing written."""

import json

import numpy as np
import pytest
from bodies import SAMPLES
from characters import as_vrm1, character, chunks, packed
from program import run
from test_characters import BONES, WALK

from distretarget import load_target, read_motion
from distretarget.errors import DistretargetError


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

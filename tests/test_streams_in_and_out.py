"""Bytes and file objects in place of paths, so that a service needs no temporary files."""

import io
import json

import numpy as np
import pytest
from bodies import SAMPLES, person, swaying
from characters import character, chunks, packed
from test_characters import BONES, WALK

from distretarget import DistretargetError, SettingsError, load_target, read_motion, retarget, write_motion
from distretarget.io.json_node import Node
from distretarget.io.skeleton_json import skeleton_to_json

CLAP = SAMPLES / "clap.bvh"


@pytest.fixture
def hero():
    made = character(BONES)
    made.animate("walk", WALK)
    return made.glb()


@pytest.mark.parametrize("given", [lambda content: content, io.BytesIO])
def test_what_is_read_from_bytes_is_what_the_file_has(tmp_path, hero, given):
    (tmp_path / "hero.glb").write_bytes(hero)
    (tmp_path / "body.json").write_text(skeleton_to_json(person(), "body"))
    np.savez(tmp_path / "clip.npz", positions=swaying(person()).positions, fps=30)
    for path in (CLAP, tmp_path / "hero.glb"):
        same = read_motion(given(path.read_bytes()))
        assert same.positions.tobytes() == read_motion(path).positions.tobytes()
    for path in (CLAP, tmp_path / "hero.glb", tmp_path / "body.json"):
        assert load_target(given(path.read_bytes())).skeleton.keys == load_target(path).skeleton.keys
    arrays = [(tmp_path / name).read_bytes() for name in ("clip.npz", "body.json")]
    assert len(read_motion(given(arrays[0]), skeleton=given(arrays[1]))) == 20


def test_the_name_of_a_file_object_stands_for_it(tmp_path):
    (tmp_path / "bad.bvh").write_text("HIERARCHY\n")
    with (tmp_path / "bad.bvh").open("rb") as file, pytest.raises(DistretargetError, match=r"bad\.bvh:1: "):
        read_motion(file)
    with pytest.raises(DistretargetError, match=r"^bytes:1: the file ends"):
        read_motion(b"HIERARCHY\n")


def test_what_is_written_to_a_file_object_is_what_a_file_gets(tmp_path, hero):
    result = retarget(read_motion(CLAP), load_target(hero))
    (tmp_path / "hero.glb").write_bytes(hero)
    for kind in ("bvh", "npz", "glb", "vrma"):
        written = io.BytesIO()
        write_motion(written, result, hero, kind=kind, name="clap")
        write_motion(tmp_path / f"clap.{kind}", result, tmp_path / "hero.glb")
        assert written.getvalue() == (tmp_path / f"clap.{kind}").read_bytes()


def test_bytes_have_no_files_beside_them(tmp_path, monkeypatch, hero):
    """Whoever sends a file to a service reads no file of the service by it."""
    monkeypatch.chdir(tmp_path)
    document, buffer = chunks(hero)
    document["buffers"][0]["uri"] = "secret.bin"
    (tmp_path / "secret.bin").write_bytes(buffer)
    with pytest.raises(DistretargetError, match=r"there is no file 'secret\.bin' beside it"):
        read_motion(json.dumps(document).encode())
    document["buffers"][0].pop("uri")
    document["images"] = [{"uri": "secret.png"}]
    (tmp_path / "secret.png").write_bytes(b"the secret")
    target = load_target(packed(document, buffer))
    assert target.mesh.file.gltf.image(Node("", "", 0.0)) == b""
    written = io.BytesIO()
    write_motion(written, read_motion(packed(document, buffer)), packed(document, buffer), kind="glb")
    assert b"the secret" not in written.getvalue()


@pytest.mark.parametrize("wrong", [3, None, io.StringIO("HIERARCHY"), ["a.bvh"]])
def test_what_is_no_file_is_refused(wrong):
    for read in (read_motion, load_target):
        with pytest.raises(SettingsError, match="expected a path, bytes, or a file opened as binary"):
            read(wrong)
    with pytest.raises(SettingsError, match="expected a path, or a file opened as binary"):
        write_motion(wrong, swaying(person()), kind="bvh")


def test_a_file_object_needs_a_kind():
    with pytest.raises(SettingsError, match="kind is None; expected one of 'bvh', 'glb'"):
        write_motion(io.BytesIO(), swaying(person()))

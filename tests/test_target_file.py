"""Target files: JSON or BVH, whole skeletons, and other bone lengths for the skeleton of a source."""

import json

import numpy as np
import pytest
from input_files import file_of
from skeleton_files import HEAD_END, HIPS, SPINE, assert_same, full, load_json, short
from table_one import table_one

from distretarget.errors import BvhError, FileError, SkeletonFileError
from distretarget.io.target_file import load_target, parse_full_target
from distretarget.target import SkeletonEdit

BVH = """HIERARCHY
ROOT Hips
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT Spine
  {
    OFFSET 0 24 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 0 18 0
    }
  }
}
MOTION
Frames: 1
Frame Time: 0.01
0 0 0 0 0 0 0 0 0
"""


def test_only_the_full_form_is_a_full_target():
    assert parse_full_target(file_of(json.dumps(full()), "a.json")).skeleton.names == ("Hips", "Spine")
    with pytest.raises(SkeletonFileError, match="short form needs a source"):
        parse_full_target(file_of(json.dumps(short(scale=2)), "a.json"))


def test_content_decides_between_json_and_bvh(tmp_path):
    (tmp_path / "bvh.json").write_text(BVH)
    (tmp_path / "json.bvh").write_text(f"\ufeff\r\n  {json.dumps(full(HIPS, SPINE, HEAD_END))}", "utf-8")
    bvh = load_target(tmp_path / "bvh.json").for_source(table_one())
    assert bvh.map == {}
    np.testing.assert_array_equal(bvh.skeleton.lengths, load_target(tmp_path / "json.bvh").skeleton.lengths)
    assert_same(load_target(tmp_path / "bvh.json").skeleton, bvh.skeleton)


def test_neither_json_nor_bvh(written):
    with pytest.raises(BvhError):
        load_target(written("name: hero"))


def test_missing_file(tmp_path):
    with pytest.raises(FileError, match="no such file"):
        load_target(tmp_path / "none.json").for_source(table_one())


@pytest.mark.parametrize(
    ("content", "name", "kind"),
    [
        (" \n{}", "a", "skeleton"),
        ("[", "a", "skeleton"),
        ("\ufeff{", "a", "skeleton"),
        (BVH, "a.glb", "glTF"),
        (BVH, "a", "BVH"),
        ('{"asset": {}}', "a.json", "glTF"),
        ("{}", "a.gltf", "glTF"),
        ("glTF", "a.bvh", "glTF"),
        ("; FBX 7.4.0\nFBXHeaderExtension: {", "a.bvh", "FBX"),
        ("Kaydara FBX Binary", "a", "FBX"),
        ("", "a.fbx", "FBX"),
    ],
)
def test_what_a_file_is(content, name, kind):
    assert file_of(content, name).kind == kind


def test_short_form_edits_the_source(written):
    source = table_one()
    document = short(scale=2, lengths={"LeftKnee": 0.5}, factors={"LeftElbow": 1.5})
    target = load_target(written(document)).for_source(source)
    expected = 2 * source.lengths
    expected[source.index("LeftElbow")] *= 1.5
    expected[source.index("LeftKnee")] = 0.5
    np.testing.assert_allclose(target.skeleton.lengths, expected, rtol=1e-14)
    assert target.skeleton.names == source.names
    assert target.map == {}


def test_short_form_without_edits_is_the_source(written):
    assert_same(load_target(written(short())).for_source(table_one()).skeleton, table_one())


def test_scale_takes_the_root_offset_along():
    source = table_one().with_offsets(table_one().offsets + 1)
    np.testing.assert_array_equal(SkeletonEdit(2, {}, {}, "").apply(source).offsets, 2 * source.offsets)


def test_edits_name_end_sites():
    source = load_json(json.dumps(full(HIPS, SPINE, HEAD_END)))
    edited = SkeletonEdit(1, {"Spine_End": 9}, {}, "").apply(source)
    np.testing.assert_allclose(edited.lengths, [0, 24, 9])


def test_bones_without_length_cannot_be_edited():
    offsets = table_one().offsets.copy()
    offsets[2] = 0
    for edit in (SkeletonEdit(1, {"Chest2": 1}, {}, "a.json"), SkeletonEdit(1, {}, {"Chest2": 2}, "a.json")):
        with pytest.raises(SkeletonFileError, match="the bone has length 0 in the source"):
            edit.apply(table_one().with_offsets(offsets))


def test_a_source_without_bones_gives_no_target(written):
    with pytest.raises(SkeletonFileError, match="all bones have length 0"):
        load_target(written(short(scale=2))).for_source(table_one().with_offsets(np.zeros((22, 3))))

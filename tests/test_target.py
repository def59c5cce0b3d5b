"""Targets: other bone lengths for the skeleton of a source."""

import json

import numpy as np
import pytest
from skeleton_files import HEAD_END, HIPS, SPINE, assert_same, full, load_json, short
from table_one import table_one

from distretarget.errors import SkeletonFileError
from distretarget.io.target_file import load_target
from distretarget.target import SkeletonEdit


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

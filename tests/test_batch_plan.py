"""The plan of a batch: which clip goes where, and what is refused."""

from pathlib import PurePath

import pytest

from distretarget.batch.clips import Clip
from distretarget.batch.plan import plan
from distretarget.errors import BatchError
from distretarget.io.files import Text


def clip(tmp_path, name, size=0):
    return Clip(tmp_path / "in" / name, PurePath(name), size)


def target(tmp_path, name="hero.json"):
    return Text("", tmp_path / name)


def test_the_largest_clips_come_first_each_onto_each_target(tmp_path):
    clips = [clip(tmp_path, "a.bvh", 1), clip(tmp_path, "b.bvh", 3), clip(tmp_path, "c/d.bvh", 2)]
    works = plan(clips, [target(tmp_path)], tmp_path / "out", [])
    assert [work.place.as_posix() for work in works] == ["b.bvh", "c/d.bvh", "a.bvh"]
    works = plan(clips, [target(tmp_path), target(tmp_path, "x.child.json")], tmp_path / "out", [])
    assert [work.place.as_posix() for work in works[:3]] == ["hero/b.bvh", "x.child/b.bvh", "hero/c/d.bvh"]
    assert len({work.place for work in works}) == 6


def test_results_that_collide_are_refused(tmp_path):
    one, other = clip(tmp_path, "a.bvh"), Clip(tmp_path / "other" / "A.bvh", PurePath("A.bvh"), 0)
    with pytest.raises(BatchError, match=r"would be the result of both .*in/a\.bvh onto .*other/A\.bvh onto"):
        plan([one, other], [target(tmp_path)], tmp_path / "out", [])
    with pytest.raises(BatchError, match="both"):
        plan([one], [target(tmp_path), target(tmp_path / "more")], tmp_path / "out", [])


def test_results_never_land_on_inputs(tmp_path):
    (tmp_path / "in").mkdir()
    for name in ("in/a.bvh", "hero.bvh"):
        (tmp_path / name).touch()
    with pytest.raises(BatchError, match="is an input"):
        plan([clip(tmp_path, "a.bvh")], [target(tmp_path)], tmp_path / "in", [])
    with pytest.raises(BatchError, match="is an input"):
        plan([clip(tmp_path, "hero.bvh")], [target(tmp_path, "hero.bvh")], tmp_path, [])
    (tmp_path / "link").symlink_to(tmp_path / "in")
    with pytest.raises(BatchError, match="is an input"):
        plan([clip(tmp_path, "a.bvh")], [target(tmp_path)], tmp_path / "link", [])
    assert plan([clip(tmp_path, "a.bvh")], [target(tmp_path)], tmp_path, [])


def test_no_name_of_a_target_leads_out_of_the_folder_of_results(tmp_path):
    targets = [target(tmp_path, name) for name in ("...json", "..json", "..", "hero.json")]
    works = plan([clip(tmp_path, "a.bvh")], targets[:2] + targets[3:], tmp_path / "out", [])
    assert {work.place.as_posix() for work in works} == {"...json/a.bvh", "..json/a.bvh", "hero/a.bvh"}


def test_the_folder_of_results_is_not_inside_a_source(tmp_path):
    (tmp_path / "in").mkdir()
    for folder in (tmp_path / "in" / "out", tmp_path / "in", tmp_path / "x" / ".." / "in" / "y"):
        with pytest.raises(BatchError, match="is inside"):
            plan([], [target(tmp_path)], folder, [tmp_path / "in"])
    assert plan([], [target(tmp_path)], tmp_path / "in2", [tmp_path / "in"]) == []

"""The plan of a batch: which files are clips, where their results go, and what is refused."""

import os
import subprocess
import sys
from pathlib import Path, PurePath

import pytest
from input_files import named_target

from distretarget.batch.plan import animations_of, find_clips, plan
from distretarget.errors import BatchError


def made(root, *names):
    for number, name in enumerate(names):
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("x" * number)
    return root


def places(found):
    """The places of results, which have no suffix yet."""
    clips, _ = found
    return [f"{place.as_posix()}.bvh" for _, place in clips]


def test_the_tree_of_a_folder_is_mirrored(tmp_path):
    made(tmp_path, "b.bvh", "a/x.BVH", "a/deep/y.bvh", "readme.txt", ".hidden/z.bvh", "a/._x.BVH", "c.bvh.txt")
    found = find_clips([tmp_path])
    assert places(found) == ["a/deep/y.bvh", "a/x.bvh", "b.bvh"]
    assert [path for path, _ in found[0]] == [tmp_path / "a/deep/y.bvh", tmp_path / "a/x.BVH", tmp_path / "b.bvh"]
    for name in ("alone.bvh", "duet/lead.bvh", "duet/scene.json"):
        (tmp_path / "all" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "all" / name).touch()
    assert places(find_clips([tmp_path / "all"])) == ["alone.bvh"]


def test_several_sources_keep_their_names(tmp_path):
    made(tmp_path, "walks/a.bvh", "runs/a.bvh", "single.bvh")
    found = find_clips([tmp_path / "walks", tmp_path / "runs", tmp_path / "single.bvh"])
    assert sorted(places(found)) == ["runs/a.bvh", "single.bvh", "walks/a.bvh"]
    made(tmp_path, "walk.01", "walk.02", "motion.txt")
    found = find_clips([tmp_path / name for name in ("walk.01", "walk.02", "motion.txt")])
    assert places(found) == ["walk.01.bvh", "walk.02.bvh", "motion.txt.bvh"]


@pytest.mark.parametrize(
    ("include", "exclude", "expected"),
    [
        (["walk*"], [], ["a/walk1.bvh", "walk2.bvh"]),
        ([], ["walk*"], ["a/run1.bvh", "run2.bvh"]),
        (["a/*"], [], ["a/run1.bvh", "a/walk1.bvh"]),
        (["*1.bvh"], ["a/run*"], ["a/walk1.bvh"]),
        (["none"], [], []),
        (["**/*1.bvh"], ["**/walk*"], ["a/run1.bvh"]),
        (["**/*2.bvh"], [], ["run2.bvh", "walk2.bvh"]),
        ([], ["a"], ["run2.bvh", "walk2.bvh"]),
        ([], ["?/"], ["run2.bvh", "walk2.bvh"]),
        (["a/"], ["*walk*"], ["a/run1.bvh"]),
        ([], ["?"], ["a/run1.bvh", "a/walk1.bvh", "run2.bvh", "walk2.bvh"]),
    ],
)
def test_patterns_choose_by_name_or_path(tmp_path, include, exclude, expected):
    made(tmp_path, "a/walk1.bvh", "a/run1.bvh", "walk2.bvh", "run2.bvh")
    assert places(find_clips([tmp_path], include=include, exclude=exclude)) == expected


def test_listed_files_keep_their_places_below_the_folder_they_share(tmp_path, monkeypatch):
    made(tmp_path, "mocap/a/x.bvh", "mocap/b/x.bvh", "one/y.bvh")
    paths = [tmp_path / "mocap/a/x.bvh", tmp_path / "mocap/b/x.bvh"]
    assert places(find_clips([], paths)) == ["a/x.bvh", "b/x.bvh"]
    assert places(find_clips([], paths[:1])) == ["x.bvh"]
    monkeypatch.chdir(tmp_path)
    listed = [path.relative_to(tmp_path) for path in (*paths, tmp_path / "one/y.bvh")]
    assert places(find_clips([], listed)) == ["mocap/a/x.bvh", "mocap/b/x.bvh", "one/y.bvh"]


def test_links_are_followed_but_not_in_circles(tmp_path):
    made(tmp_path, "in/a/x.bvh", "elsewhere/y.bvh")
    (tmp_path / "in/a/up").symlink_to(tmp_path / "in")
    (tmp_path / "in/other").symlink_to(tmp_path / "elsewhere")
    (tmp_path / "elsewhere/back").symlink_to(tmp_path / "in/a")
    assert places(find_clips([tmp_path / "in"])) == ["a/x.bvh", "other/back/x.bvh", "other/y.bvh"]


@pytest.mark.parametrize("place", ["in/up", "in/a/up"])
@pytest.mark.parametrize("to", [".", "in", "other"])
def test_a_link_to_a_folder_above_converts_nothing_twice(tmp_path, monkeypatch, place, to):
    made(tmp_path, "in/a/x.bvh", "y.bvh")
    (tmp_path / "other").symlink_to(tmp_path / "in")
    (tmp_path / place).symlink_to(tmp_path / to)
    monkeypatch.chdir(tmp_path)
    for source in ("in", "other"):
        assert places(find_clips([Path(source)])) == ["a/x.bvh"]


def test_links_that_lead_nowhere_are_reported(tmp_path):
    made(tmp_path, "a.bvh")
    (tmp_path / "self").symlink_to("self")
    (tmp_path / "self.bvh").symlink_to("self.bvh")
    (tmp_path / "gone").symlink_to("nowhere")
    found = find_clips([tmp_path])
    assert places(found) == ["a.bvh", "self.bvh"]  # which fails when it is read
    assert [str(error).split(": ")[0] for error in found[1]] == [str(tmp_path / "self")]


FIND_AS_NOBODY = """
import os
from pathlib import Path
from distretarget.batch.plan import find_clips

if os.geteuid() == 0:  # who may read every folder
    os.seteuid(65534)
clips, unread = find_clips([Path()])
print([place.as_posix() for _, place in clips], sorted(str(error) for error in unread))
print([place.as_posix() for _, place in find_clips([Path("closed/b.bvh")])[0]])
"""


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="needs permissions as Unix has them")
def test_folders_without_permission_are_reported(tmp_path):
    """In a process of its own: what other tests left behind in this one belongs to its user."""
    made(tmp_path, "a.bvh", "closed/b.bvh", "closed/in/c.bvh")
    (tmp_path / "link").symlink_to("closed/in")
    tmp_path.chmod(0o755)
    (tmp_path / "closed").chmod(0)
    done = subprocess.run([sys.executable, "-c", FIND_AS_NOBODY], cwd=tmp_path, capture_output=True, text=True)
    (tmp_path / "closed").chmod(0o700)
    assert done.stderr == ""
    assert done.stdout.splitlines() == ["['a'] ['closed: permission denied', 'link: permission denied']", "['b']"]


def test_links_to_nothing_and_missing_files_are_clips_that_will_fail(tmp_path):
    (tmp_path / "gone.bvh").symlink_to(tmp_path / "nowhere")
    assert places(find_clips([tmp_path])) == ["gone.bvh"]
    assert places(find_clips([tmp_path / "none.bvh"])) == ["none.bvh"]


# ---- places of results


def clip(tmp_path, name, size=0):
    path = tmp_path / "in" / name
    if size:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("x" * size)
    return path, PurePath(name.removesuffix(".bvh"))


def target(tmp_path, name="hero.json"):
    return named_target("{}", tmp_path / name)


def test_the_largest_clips_come_first_each_onto_each_target(tmp_path):
    found = [clip(tmp_path, "a.bvh", 1), clip(tmp_path, "b.bvh", 3), clip(tmp_path, "c/d.bvh", 2), clip(tmp_path, "0")]
    clips = plan(found, [target(tmp_path)], tmp_path / "out", [])
    assert [clip.output for clip in clips] == ["b.bvh", "c/d.bvh", "a.bvh", "0.bvh"]
    assert [clip.size for clip in clips] == [3, 2, 1, 0]
    clips = plan(found[:3], [target(tmp_path), target(tmp_path, "x.child.json")], tmp_path / "out", [])
    assert [clip.output for clip in clips[:3]] == ["hero/b.bvh", "x.child/b.bvh", "hero/c/d.bvh"]
    assert len({clip.output for clip in clips}) == 6


def test_results_that_collide_are_refused(tmp_path):
    one, other = clip(tmp_path, "a.bvh"), (tmp_path / "other" / "A.bvh", PurePath("A"))
    with pytest.raises(BatchError, match=r"would be the result of both .*in/a\.bvh onto .*other/A\.bvh onto"):
        plan([one, other], [target(tmp_path)], tmp_path / "out", [])
    with pytest.raises(BatchError, match="both"):
        plan([one], [target(tmp_path), target(tmp_path / "more")], tmp_path / "out", [])
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
    clips = plan([clip(tmp_path, "a.bvh")], targets[:2] + targets[3:], tmp_path / "out", [])
    assert {clip.output for clip in clips} == {"...json/a.bvh", "..json/a.bvh", "hero/a.bvh"}
    (tmp_path / "in").mkdir()
    for folder in (tmp_path / "in" / "out", tmp_path / "in", tmp_path / "x" / ".." / "in" / "y"):
        with pytest.raises(BatchError, match="is inside"):
            plan([], [target(tmp_path)], folder, [tmp_path / "in"])
    assert plan([], [target(tmp_path)], tmp_path / "in2", [tmp_path / "in"]) == []


@pytest.mark.parametrize("name", ["bad.fbx", "bad.glb"])
def test_a_file_that_cannot_be_read_is_one_clip_that_will_fail(tmp_path, name):
    (tmp_path / name).write_bytes(b"no file of this kind")
    assert animations_of(tmp_path / name) == {None: ""}

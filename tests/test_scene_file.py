"""Scene files, those of the samples too, and `distretarget scene`: what they say, and faults told with their place."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import sample_scenes
from bodies import SAMPLES, person, sample_target, swaying
from program import refused, run
from schemas import validator

from distretarget import Edits, MotionError, SkeletonFileError, diff, read_bvh, read_motion, retarget_scene, write_bvh
from distretarget.batch import results
from distretarget.errors import FileError
from distretarget.io.files import write_whole
from distretarget.scene.props import Grip
from distretarget.scene.scene_file import from_start, load_scene, synchronised

SCENES = sorted((SAMPLES / "scenes").glob("*/scene.json"))
ONE = {"source": "one.bvh", "target": "child.json"}
HEAD = {"format": "distretarget-scene", "version": 1}
STAFF = {"name": "staff", "file": "staff.bvh"}


def written(folder, document):
    path = folder / "scene.json"
    path.write_text(json.dumps(document))
    return path


@pytest.mark.parametrize("path", SCENES, ids=lambda path: path.parent.name)
def test_the_samples_are_valid(path):
    assert validator("io/scene").is_valid(json.loads(path.read_text()))
    assert all(file.exists() for file in load_scene(path).inputs)


def test_everything_that_a_scene_may_say(tmp_path):
    document = {
        **HEAD,
        "performers": [
            {
                **ONE,
                "name": "lead",
                "map": "lead.map.json",
                "start": 0.5,
                "skin": "fat.glb",
                "source_skin": "actor.glb",
            },
            {**ONE, "name": "follower", "skin": "average"},
        ],
        "props": [
            {**STAFF, "scale": 1, "start": 0.5, "held_by": [{"performer": "follower", "joint": "LeftWrist"}]},
            {"name": "sword", "part_of": {"performer": "lead", "joint": "Sword"}, "scale": "lead"},
        ],
        "world_scale": 0.9,
        "supports": "feet",
        "environment": "scaled",
        "skin": "none",
        "cut": True,
        "resample": True,
        "end": "90f",
        "speed": 2,
        "mirror": False,
        "turn": -30,
        "loop": True,
    }
    assert validator("io/scene").is_valid(document)
    setup = load_scene(written(tmp_path, document))
    assert setup.names == ["lead", "follower", "staff", "sword"]
    staff, sword = setup.props
    assert staff.file == tmp_path / "staff.bvh"
    assert staff.scale == 1.0
    assert isinstance(staff.scale, float)
    assert staff.held_by == (Grip(1, "LeftWrist"),)
    assert sword.part_of == Grip(0, "Sword")
    assert sword.scale == 0
    assert (setup.world_scale, setup.supports, setup.environment, setup.cut, setup.resample) == (
        0.9,
        "feet",
        "scaled",
        1,
        1,
    )
    assert setup.skin == "none"
    assert setup.edits == Edits(end="90f", speed=2.0, turn=-30.0, loop=True)
    lead, follower = setup.performers
    assert lead.start == 0.5
    assert (lead.skin, lead.source_skin) == (tmp_path / "fat.glb", tmp_path / "actor.glb")
    assert (follower.skin, follower.source_skin) == ("average", None)
    assert {*lead.skin_files} <= {*setup.inputs}


BAD = {
    "unknown key": ({**HEAD, "performers": [{**ONE, "targt": "x"}]}, "performers[0].targt", "unknown key"),
    "other format": ({**HEAD, "format": "x", "performers": [ONE]}, "format", '"distretarget-scene"'),
    "nobody": ({**HEAD, "performers": []}, "performers", "at least one performer"),
    "file and prop": (
        {**HEAD, "performers": [ONE], "props": [{**STAFF, "part_of": {"performer": "one", "joint": "x"}}]},
        "props[0]",
        'either "file" or "part_of"',
    ),
    "negative start": ({**HEAD, "performers": [{**ONE, "start": -1}]}, "performers[0].start", "from 0"),
    "name of a drive": ({**HEAD, "performers": [{**ONE, "name": "C:x"}]}, "performers[0].name", "slashes and colons"),
    "name of a device": (
        {**HEAD, "performers": [{**ONE, "name": "Con"}]},
        "performers[0].name",
        "that a file can have",
    ),
    "name of a file": (
        {**HEAD, "performers": [{**ONE, "name": "aux.b"}]},
        "performers[0].name",
        "that a file can have",
    ),
    "name with an end": ({**HEAD, "performers": [{**ONE, "name": "x."}]}, "performers[0].name", "that a file can have"),
    "name of a path": ({**HEAD, "performers": [{**ONE, "name": "../x"}]}, "performers[0].name", "without slashes"),
    "other supports": ({**HEAD, "performers": [ONE], "supports": "all"}, "supports", "one of"),
    "no speed": ({**HEAD, "performers": [ONE], "speed": 0}, "speed", "above 0"),
    "no flag": ({**HEAD, "performers": [ONE], "cut": 1}, "cut", "true or false"),
    "no skin": (
        {**HEAD, "performers": [{**ONE, "skin": "avrage"}]},
        "performers[0].skin",
        '"thin", "fat", "muscular" or the path of a character',
    ),
    "skin of nobody": (
        {**HEAD, "performers": [{**ONE, "skin": "none", "source_skin": "actor.glb"}]},
        "performers[0].source_skin",
        'leave out "source_skin"',
    ),
    "same names": ({**HEAD, "performers": [ONE, ONE]}, "performers", "the name of two"),
    "no such performer": (
        {**HEAD, "performers": [ONE], "props": [{**STAFF, "scale": "two"}]},
        "props[0].scale",
        "did you mean",
    ),
}
BEYOND_THE_SCHEMA = {"same names", "no such performer"}


@pytest.mark.parametrize("name", BAD)
def test_what_is_refused(name, tmp_path):
    document, place, words = BAD[name]
    with pytest.raises(SkeletonFileError) as caught:
        load_scene(written(tmp_path, document))
    assert caught.value.place == place
    assert words in caught.value.reason or name == "no such performer"
    assert validator("io/scene").is_valid(document) == (name in BEYOND_THE_SCHEMA)


def test_the_command_converts_a_scene_and_a_folder_of_scenes(tmp_path):
    staff = SAMPLES / "scenes" / "staff"
    done = run("scene", staff / "scene.json", "-o", tmp_path / "one")
    assert done.returncode == 0, done.stderr
    assert "performer and staff: contacts in 157 frames" in done.stdout
    assert len(read_bvh(tmp_path / "one" / "staff.bvh")) == 157
    done = run("scene", staff.parent, "-o", tmp_path / "all")
    assert done.returncode == 0, done.stderr
    assert {path.parent.name for path in (tmp_path / "all").rglob("*.bvh")} == {path.parent.name for path in SCENES}
    assert (tmp_path / "all" / "staff" / "staff.bvh").read_bytes() == (tmp_path / "one" / "staff.bvh").read_bytes()


def test_a_prop_in_a_performers_file_is_held_by_the_joint_above_it(tmp_path):
    source = SAMPLES / "scenes" / "staff" / "performer.bvh"
    document = {
        **HEAD,
        "performers": [{"source": str(source), "target": str(SAMPLES / "child.json")}],
        "props": [{"name": "hand", "part_of": {"performer": "performer", "joint": "RightWrist"}}],
    }
    _, (prop,) = load_scene(written(tmp_path, document)).read()
    assert prop.held_by == (Grip(0, "RightElbow"),)
    assert prop.motion.skeleton.names[0] == "RightWrist"


def test_one_performer_has_the_very_bytes_of_retarget(tmp_path):
    source, child = SAMPLES / "walk.bvh", SAMPLES / "child.json"
    document = {**HEAD, "performers": [{"source": str(source), "target": str(child)}]}
    assert run("scene", written(tmp_path, document), "-o", tmp_path / "out").returncode == 0
    assert run(source, child, "-o", tmp_path / "walk.bvh").returncode == 0
    assert (tmp_path / "out" / "walk.bvh").read_bytes() == (tmp_path / "walk.bvh").read_bytes()


def test_the_command_refuses_in_one_line(tmp_path):
    walk, staff = SAMPLES / "walk.bvh", SAMPLES / "scenes" / "staff" / "scene.json"
    (tmp_path / "empty").mkdir()
    bad = {**HEAD, "performers": [{"source": str(walk), "target": str(SAMPLES / "child.json"), "start": 99}]}
    for arguments, status, words in (
        ([walk], 2, "Missing option"),
        ([staff, "--cut"], 2, "--cut belongs in the scene file"),
        ([staff, "--supports", "feet"], 2, "--supports belongs in the scene file"),
        ([tmp_path / "empty"], 1, "has no scene.json"),
        ([written(tmp_path, bad)], 1, "start before that"),
    ):
        done = run("scene", *arguments, "-o", tmp_path / "out")
        assert done.returncode == status
        assert words in done.stderr
        assert len(done.stderr.splitlines()) == 1
        assert not (tmp_path / "out").exists()


def swayed():
    return swaying(person(), frames=21)


def test_starts_and_cuts_leave_the_common_frames():
    motion = swayed()
    late, early = synchronised([from_start(motion, 5 * motion.frame_time), motion], cut=True, resample=False)
    assert len(late) == len(early) == 16
    np.testing.assert_array_equal(late.positions, motion.positions[5:])
    np.testing.assert_array_equal(early.positions, motion.positions[:16])


def slow_and_fast():
    """Two frames 1000 s apart, and two frames 0.00001 s apart."""
    motion = swaying(person(), frames=2)
    return replace(motion, frame_time_text="1000"), replace(motion, frame_time_text="0.00001")


def test_clips_are_cut_before_they_are_resampled():
    slow, fast = slow_and_fast()
    assert [len(motion) for motion in synchronised([fast, slow], cut=True, resample=True)] == [2, 2]
    assert len(diff(slow, fast).a) == 2
    with pytest.raises(MotionError, match="clip 2 has 100000001 frames of 1e-05 s, and clip 1 has 2; cut them"):
        synchronised([fast, slow], cut=False, resample=True)


def test_resampling_does_not_make_many_frames_of_few(tmp_path):
    slow, _ = slow_and_fast()
    with pytest.raises(
        MotionError, match=r"1,000,001 frames of 0\.001 s; expected at most 20 for each of its 2 frames"
    ):
        slow.resampled("0.001")
    write_bvh(tmp_path / "slow.bvh", slow)
    with pytest.raises(MotionError, match=r"slow\.bvh: lasts 1000 s"):
        read_motion(tmp_path / "slow.bvh", fps=1000.0)


@pytest.mark.parametrize("frames", [(1, 1), (1, 4), (4, 1), (4, 2)])
def test_a_cut_leaves_the_frames_of_the_shortest_down_to_one(frames):
    motions = [swayed()[:count] for count in frames]
    assert {len(motion) for motion in synchronised(motions, cut=True, resample=True)} == {min(frames)}
    motions = [from_start(motion, 0.0) for motion in motions]
    assert len(retarget_scene(synchronised(motions, cut=True, resample=False), [person()] * 2).results) == 2


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The working folder, with a clip, and a scene of it in scenes/one."""
    monkeypatch.chdir(tmp_path)
    write_bvh("clip.bvh", swaying(person(), frames=4))
    scene_with(tmp_path / "scenes" / "one")
    return tmp_path


def scene_with(folder, performer=(), **others):
    """Write a scene of one performer into a folder that is made."""
    folder.mkdir(parents=True)
    clip = folder.parents[1] / "clip.bvh"
    one = {"name": "lead", "source": str(clip), "target": str(clip), **dict(performer)}
    document = {"format": "distretarget-scene", "version": 1, "performers": [one], **others}
    (folder / "scene.json").write_text(json.dumps(document))


# ---- folders of scenes


def test_a_folder_of_scenes_goes_on_where_it_stopped(folder):
    scenes = folder / "scenes"
    scene_with(scenes / "broken")
    (scenes / "broken" / "scene.json").write_text("{")
    scene_with(scenes / "missing", {"source": str(folder / "later.bvh")})
    first = run("scene", "scenes", "-o", "out")
    assert (first.returncode, first.stderr.count("failed: ")) == (1, 2)
    assert first.stdout.endswith("3 scenes: 1 converted, 0 done before, 2 failed\n")
    made = (folder / "out" / "one" / "lead.bvh").stat().st_mtime_ns
    write_bvh("later.bvh", swaying(person(), frames=4))
    (scenes / "broken" / "scene.json").unlink()
    second = run("scene", "scenes", "-o", "out")
    assert (second.returncode, second.stderr) == (0, "")
    assert second.stdout.endswith("2 scenes: 1 converted, 1 done before, 0 failed\n")
    assert (folder / "out" / "one" / "lead.bvh").stat().st_mtime_ns == made


def test_a_scene_goes_on_after_a_full_disk(folder, monkeypatch):
    """The prop is scene_with before the performer, for which there is no space."""
    write_bvh("box.bvh", swaying(person(), frames=4))
    scene_with(folder / "scenes" / "two", props=[{"name": "box", "file": str(folder / "box.bvh")}])

    def on_a_full_disk(path, *others, **options):
        if path.name == "lead.bvh":
            raise FileError(path, "the disk is full")
        write_whole(path, *others, **options)

    with monkeypatch.context() as full:
        full.setattr(results, "write_whole", on_a_full_disk)
        first = run("scene", "scenes", "-o", "out")
    assert first.stdout.endswith("2 scenes: 0 converted, 0 done before, 2 failed\n")
    assert (folder / "out" / "two" / "box.bvh").exists()
    second = run("scene", "scenes", "-o", "out")
    assert (second.returncode, second.stderr) == (0, "")
    assert second.stdout.endswith("2 scenes: 2 converted, 0 done before, 0 failed\n")


def test_a_scene_that_has_changed_is_made_again_and_other_files_stay(folder):
    run("scene", "scenes", "-o", "out")
    write_bvh("clip.bvh", swaying(person(), frames=5), overwrite=True)
    done = run("scene", "scenes", "-o", "out", "--report", "report.html")
    assert done.stdout.endswith("1 scene: 1 converted, 0 done before, 0 failed\n")
    assert "Frames: 5" in (folder / "out" / "one" / "lead.bvh").read_text()
    (folder / "out" / "one" / "lead.bvh").write_text("mine")
    assert "exists already; --overwrite replaces it" in run("scene", "scenes", "-o", "out").stderr
    assert (folder / "out" / "one" / "lead.bvh").read_text() == "mine"


# ---- links


def test_no_link_leads_out_of_the_folder_of_results(folder):
    (folder / "outside").mkdir()
    (folder / "precious.bvh").write_text("precious")
    (folder / "out").mkdir()
    (folder / "out" / "one").symlink_to(folder / "outside")
    (folder / "out" / "lead.bvh").symlink_to(folder / "precious.bvh")
    for source in ("scenes", "scenes/one/scene.json"):
        done = run("scene", source, "-o", "out", "--overwrite")
        assert done.returncode == 1
        assert "leads out of the folder 'out'; remove the link" in done.stderr
    assert not list((folder / "outside").iterdir())
    assert (folder / "precious.bvh").read_text() == "precious"


def test_a_scene_file_takes_no_target(folder):
    scene = folder / "one" / "scene.json"
    line = refused("scene", scene, "-t", SAMPLES / "child.json", "-o", folder / "out", status=2)
    assert "scene.json is a scene or a folder of scenes, which name their targets; leave out -t." in line


ARM = 53.1  # length of the sample body's arm [cm]
OFF = 0.01  # how far the gap of a contact may be off the source's, in the source's world [arms]
# ... and between a child and a body of the source's size, as docs/scenes.md has it
OFF_BETWEEN_SIZES = {"push": 0.0255, "waltz": 0.02, "lift": 0.032, "handshake": 0.052, "high_five": 0.065}

scenes = pytest.mark.parametrize("name", sample_scenes.SCENES)


@cache
def made(name):
    return sample_scenes.SCENES[name]()


@cache
def result(name):
    return load_scene(SAMPLES / "scenes" / name / "scene.json").retargeted()


def gaps(contact, sources, motions):
    """(frames,), how far what touches is apart."""
    frames = slice(contact.first, contact.last + 1)
    one, other = contact.one[0], contact.other[0]
    x = motions[one][frames, joint_of(contact.one, sources)]
    if other < len(sources):
        return np.linalg.norm(x - motions[other][frames, joint_of(contact.other, sources)], axis=1)
    return np.linalg.norm(x[:, None] - motions[other][frames], axis=2).min(axis=1)


def joint_of(place, sources):
    number, joint = place
    return sources[number].skeleton.index(joint)


def check_gaps(name, done, off):
    """Check that known contacts are no further off than this [arms]."""
    sources = [one.source for one in done.results]
    before = [motion.positions for motion in [*sources, *(prop.source for prop in done.props)]]
    after = [each.motion.positions for each in (*done.results, *done.props)]
    for contact in made(name).contacts:
        prop = contact.other[0] - len(sources)
        scale = done.props[prop].scale if prop >= 0 else done.world_scale
        source, now = gaps(contact, sources, before), gaps(contact, sources, after) / scale
        assert source.max() < 0.2 * ARM, contact
        assert np.abs(now - source).max() < off * ARM, contact


@scenes
def test_what_touches_in_the_sample_touches_on_a_child(name):
    check_gaps(name, result(name), OFF)


@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize("name", OFF_BETWEEN_SIZES)
def test_what_touches_between_a_child_and_an_adult_stays_near(name, order):
    sources = list(made(name).performers.values())
    body = sources[0].rigid_skeleton
    child = sample_target("child").for_source(body).skeleton
    check_gaps(name, retarget_scene(sources, [child, body][::order]), OFF_BETWEEN_SIZES[name])


@scenes
def test_performers_are_solved_and_their_feet_stand(name):
    for one in result(name).results:
        metrics = one.metrics["result"]
        assert metrics["not_converged"] == 0
        assert metrics["turn"] < 15
        assert (metrics["foot_height"] or 0.0) < 0.5


def test_a_staff_keeps_its_shape_in_both_hands():
    (staff,) = result("staff").props
    assert staff.scale == pytest.approx(0.6)
    lengths = np.linalg.norm(staff.motion.positions[:, 1] - staff.motion.positions[:, -1], axis=1)
    np.testing.assert_allclose(lengths, 0.6 * 160)

"""The spread of the alignments of clips of one rig over a batch."""

import base64
from contextlib import closing

import numpy as np
import pytest
from bodies import PERSON, matched, posed
from program import last_records
from scipy.spatial.transform import Rotation

from distretarget import convert_folder, write_bvh
from distretarget.batch.results import Database
from distretarget.batch.summary import SCALE, SPREAD_ROLES, alignment_text, largest_spread, spread_warnings


def clip(head=0.0, scale=1.0):
    """A person, larger or smaller, who stands and nods by an angle [degrees]."""
    turns = {"Head": np.radians([head, 0.0, 0.0])}
    return posed(PERSON.with_lengths(scale * PERSON.lengths), turns, np.tile([0.0, 0.9 * scale, 0.0], (10, 1)))


def alignment(angle):
    """The rotations of an alignment as text, with a head turned by an angle [degrees]."""
    rotations = np.zeros((len(SPREAD_ROLES), 4))
    rotations[SPREAD_ROLES.index("head")] = SCALE * Rotation.from_euler("X", angle, degrees=True).as_quat()
    return base64.b64encode(np.round(rotations).astype("<i2").tobytes()).decode()


def record(name, text, target="hero.json"):
    return {"output": name, "alignment": text, "target": target, "target_hash": target, "options": {}}


def test_the_largest_spread_is_between_the_two_clips_that_differ_most():
    angles = np.zeros((4, 3))
    angles[:, 1] = [0.0, -20.0, 5.0, 30.0]
    rotations = Rotation.from_euler("X", angles.reshape(-1, 1), degrees=True).as_quat().reshape(4, 3, 4)
    rotations[2] *= -1.0  # the same rotations
    rotations[1, 2] = 0.0  # unknown
    angle, joint, *clips = largest_spread(rotations)
    assert angle == pytest.approx(50.0)
    assert (joint, {*clips}) == (1, {1, 3})


def test_clips_of_a_rig_that_stands_are_aligned_alike():
    texts = [alignment_text(matched(clip(*each), PERSON)) for each in ((), (50.0,), (0.0, 1.3))]
    assert len({*texts}) == 1
    assert not [*spread_warnings(record(f"{k}.bvh", text) for k, text in enumerate(texts))]
    turned = Rotation.from_euler("X", 90, degrees=True).apply(np.array(PERSON.offsets))
    assert alignment_text(matched(PERSON.with_offsets(turned), PERSON)).split(":")[0] != texts[0].split(":")[0]


def test_clips_that_are_not_are_named():
    records = [record(f"{k}.bvh", f"rig:{alignment(angle)}") for k, angle in enumerate((0.0, 3.0, 30.0))]
    (line,) = spread_warnings(records)
    assert line.startswith("warning: 3 clips of one rig are aligned with hero.json in ways that differ by up to 30 deg")
    assert "(head, 2.bvh and 0.bvh)" in line
    assert not [*spread_warnings(records[:2])]


@pytest.mark.parametrize("text", ["", "rig", "rig:", "rig:AAAA", "rig:\u00e9", "rig:{}"])
def test_what_is_no_alignment_is_passed_over(text):
    assert not [*spread_warnings([record("a.bvh", text), record("b.bvh", f"rig:{alignment(0.0)}")])]


def test_clips_of_other_rigs_or_targets_may_be_aligned_otherwise():
    records = [record(f"{k}.bvh", f"rig {k}:{alignment(30.0 * k)}") for k in range(3)]
    assert not [*spread_warnings(records)]
    records = [record(f"{k}.bvh", f"rig:{alignment(30.0 * k)}", f"{k}.json") for k in range(3)]
    assert not [*spread_warnings(records)]


def test_a_batch_that_goes_on_warns_of_clips_that_are_done(tmp_path):
    (tmp_path / "clips").mkdir()
    for name in "ab":
        write_bvh(tmp_path / "clips" / f"{name}.bvh", clip())
    write_bvh(tmp_path / "hero.bvh", clip())
    batch = tmp_path / "clips", tmp_path / "hero.bvh", tmp_path / "out"
    assert not convert_folder(*batch, jobs=1).alignments
    first = last_records(tmp_path / "out")["a.bvh"]
    rig, text = first["alignment"].split(":")
    rotations = np.frombuffer(base64.b64decode(text), "<i2").reshape(-1, 4).copy()
    rotations[SPREAD_ROLES.index("head")] = np.round(SCALE * np.sqrt(0.5)), 0, 0, np.round(SCALE * np.sqrt(0.5))
    other = base64.b64encode(rotations.tobytes()).decode()
    with closing(Database(tmp_path / "out")) as database:
        database.add(first | {"alignment": f"{rig}:{other}"})
    again = convert_folder(*batch, jobs=1)
    assert again.skipped == 2
    (line,) = again.alignments
    assert "differ by up to 90 degrees (head," in line
    assert line in again.lines

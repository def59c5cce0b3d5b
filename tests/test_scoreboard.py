"""The scoreboard measures what it says: known answers on a hand and a box, and the skin of the sample character."""

import gltf_player
import numpy as np
import pytest
from bodies import HERO, sample, sample_target
from scipy.sparse import csr_array
from scipy.spatial import KDTree

from distretarget import retarget, write_motion

pytest.importorskip("igl")
import scoreboard
from contestants import Contestant
from skins import PARTS, Sinking, Skin, Solid, gap_error, gap_to

CORNERS = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
QUADS = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
SIDES = np.array([[quad[0], *quad[n : n + 2]] for quad in QUADS for n in (1, 2)])  # of a box; from outside
OUTSIDE = np.array([3.0, 0.5, 0.5])


def hand_at(middle):
    """The points of a box of the size 1, and of a hand of the size 0.2 about a place."""
    return np.vstack([CORNERS, 0.2 * (CORNERS - 0.5) + middle])


def box_and_hand(without=()):
    """The box, without some of its sides, as the hips of a body, and its hand, which is outside in the bind pose."""
    box = np.delete(SIDES, [2 * side + half for side in without for half in (0, 1)], axis=0)
    parts = np.repeat([PARTS.index("hips"), PARTS.index("left hand")], 8)
    weights = csr_array(np.repeat(np.eye(2), 8, axis=0))
    return Skin(None, hand_at(OUTSIDE), weights, np.vstack([box, SIDES + 8]), parts)


@pytest.mark.parametrize("without", [(), (0,), (0, 1)], ids=["closed", "open", "open twice"])
@pytest.mark.parametrize(
    ("middle", "share", "depth"), [([0.5, 0.5, 0.5], 1.0, 40.0), ([0.5, 1.0, 0.5], 0.5, 10.0), (OUTSIDE, 0.0, 0.0)]
)
def test_a_hand_sinks_into_a_box(without, middle, share, depth):
    found = Sinking(box_and_hand(without)).of_frame(hand_at(middle))
    assert found == pytest.approx((share, depth))


def test_what_is_inside_in_the_bind_pose_does_not_count():
    skin = box_and_hand()
    sunken = Skin(None, hand_at([0.5, 1.0, 0.5]), skin.weights, skin.triangles, skin.parts)
    assert len(Sinking(skin).limbs) == 8
    assert len(Sinking(sunken).limbs) == 4


@pytest.mark.parametrize(("middle", "gap"), [(OUTSIDE, 1.9), ([0.5, 1.15, 0.5], 0.05), ([0.5, 0.5, 0.5], -0.4)])
def test_gap_between_a_hand_and_a_box(middle, gap):
    points = hand_at(middle)
    assert gap_to(Solid(box_and_hand(), "hips"), points, points[8:]) == pytest.approx(gap)


def test_gaps_count_where_the_source_is_in_contact():
    of_source = np.array([[0.0, 9.0], [1.0, 9.0]])
    assert gap_error(np.array([[-2.0, np.nan], [2.0, np.nan]]), of_source) == pytest.approx(1.5)
    assert np.isnan(gap_error(of_source, np.full((2, 2), 9.0)))


def test_a_skin_is_posed_as_a_player_poses_the_file(tmp_path):
    target = sample_target("hero")
    motion = retarget(sample("clap")[100:102], target).motion
    written = tmp_path / "hero.glb"
    write_motion(written, motion, HERO, name="clap")
    document, buffer = gltf_player.load(written)
    placed = gltf_player.worlds(document, buffer, "clap", motion.frame_time * np.arange(2))
    expected = np.concatenate(gltf_player.skinned(document, buffer, placed), axis=1)
    skin = Skin.read(HERO, target.skeleton)
    for points, wanted in zip(skin.frames(motion, np.arange(2)), expected, strict=True):
        for these, those in ((points, wanted), (wanted, points)):
            assert KDTree(these).query(those)[0].max() < 1e-5
    assert set(np.unique(skin.parts)) == set(range(len(PARTS)))
    assert skin.volume > 0


def test_samples_go_to_all_bodies_and_others_to_some_in_turn():
    pairs = list(scoreboard.matrix({"walk.bvh": None, "a/x.bvh": None, "a/y.bvh": None}, ["p", "q", "r", "s"], 2))
    assert [body for clip, body in pairs if clip == "walk.bvh"] == ["p", "q", "r", "s"]
    assert [body for clip, body in pairs if clip != "walk.bvh"] == ["p", "r", "q", "s"]


def test_the_table_names_what_is_missing():
    metrics = {"here": dict.fromkeys([*scoreboard.COLUMNS, "deepest_largest", "gap_all"], 1.0) | {"gap": np.nan}}
    all_of_them = [Contestant("here", None, None), Contestant("peer", None, None, "not installed: peer")]
    head, _, *lines = (line.split(" | ") for line in scoreboard.score_table(all_of_them, metrics).splitlines())
    assert head[1:] == ["here", "peer |"]
    assert [here for _, here, _ in lines[:5]] == ["1.00", "1.0", "1.00 / 1.00", "1", "- / 1.00"]
    assert [peer for *_, peer in lines[:2]] == ["skipped: not installed: peer |", "- |"]

"""Other programs play files of characters as they should be played; the Khronos validator finds no error in them."""

import gltf_player
import pytest

from interop.played import CASES, WRITTEN, plays
from interop.players import PLAYERS, Players, missing, problems

CLOSE = 1e-4  # [m]
SLOW = {"Blender": ("armature in cm, rolled joints", "odd names", "VRM 1")}  # it takes seconds to start


@pytest.fixture(scope="module")
def players():
    with Players() as programs:
        yield programs


@pytest.mark.parametrize(
    ("program", "case"),
    [(program, case) for program in PLAYERS for case in SLOW.get(program, CASES) if plays(program, case)],
)
def test_programs_find_joints_in_the_same_places(program, case, players, tmp_path):
    if reason := missing(program):
        pytest.skip(reason)
    assert CASES[case](tmp_path).farthest(players, program) < CLOSE


@pytest.mark.parametrize(
    ("program", "case"), [(program, case) for program in PLAYERS for case in WRITTEN if plays(program, case)]
)
def test_programs_play_what_is_written(program, case, players, tmp_path):
    if reason := missing(program):
        pytest.skip(reason)
    assert WRITTEN[case](tmp_path).farthest(players, program) < CLOSE


ALL = CASES | WRITTEN


@pytest.mark.parametrize("case", ALL)
def test_the_validator_finds_no_error(case, tmp_path):
    if reason := missing("validator"):
        pytest.skip(reason)
    expected = ALL[case](tmp_path)
    assert problems(expected.path) == set()
    assert expected.vrma is None or problems(expected.vrma) == set()


@pytest.mark.parametrize("case", ALL)
def test_pygltflib_reads_the_same_nodes_and_animations(case, tmp_path):
    pygltflib = pytest.importorskip("pygltflib")
    expected = ALL[case](tmp_path)
    path = expected.vrma or expected.path
    load = pygltflib.GLTF2().load_json if path.suffix == ".gltf" else pygltflib.GLTF2().load_binary
    read, (document, _) = load(path), gltf_player.load(path)
    found = [[(each.target.node, each.target.path) for each in entry.channels] for entry in read.animations]
    assert found == [
        [(each["target"]["node"], each["target"]["path"]) for each in entry["channels"]]
        for entry in document["animations"]
    ]
    assert [node.children or [] for node in read.nodes] == [node.get("children", []) for node in document["nodes"]]

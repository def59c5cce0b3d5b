"""Sample scenes of a performer and a prop."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike
from sample_body import FRAME_TIME, STANDING, WRIST_HEIGHT, flat_hand, hand, mirrored, trunk, turned
from sample_duets import DURATION, handshake, high_five, lift, push, waltz
from sample_motions import planted_feet
from sample_partners import NEAREST, Reach, SampleScene, contact, performer
from sample_tracks import Track, bump, clock, columns, cosine, held
from scipy.spatial.transform import Rotation

from distretarget.io.obj import parse_obj
from distretarget.motion import Motion
from distretarget.scene.props import Grip, Prop
from distretarget.skeleton import POSITION_CHANNELS, ROTATION_CHANNELS, Skeleton

GRIP = 24.0  # from the middle of the staff to either hand [cm]
SEAT = 46.0  # height of the chair's seat [cm]
TABLE = 92.0  # height of the table [cm]


def staff() -> SampleScene:
    """A staff in both hands goes up and down and tilts."""
    t = clock(DURATION)
    tilt = 25.0 * cosine(t, 1.9)
    middle = columns(0.0, 118 + 10 * cosine(t, 1.3), 30.0)
    turn = Rotation.from_euler("Z", tilt[:, None], degrees=True)
    along = turn.apply([1.0, 0.0, 0.0])
    fist = hand(fingers=[0.1, 0.0, 1.0], palm=[0.0, -1.0, 0.0])
    body = trunk(
        columns(0.0, STANDING - 1.0 + 0 * t, 0.0),
        turned(pitch=3 + 0 * t),
        turned(pitch=3 + 0 * t),
        turned(pitch=6 + 0 * t),
    )
    ones = np.ones(len(t))
    reaches = {
        "Left": Reach(middle + GRIP * along, fist, ones, (0.8, -0.8, -0.1)),
        "Right": Reach(middle - GRIP * along, mirrored(fist), ones, (-0.8, -0.8, -0.1)),
    }
    points = np.array([[x, 0.0, 0.0] for x in (-80, -50, -GRIP, GRIP, 50, 80)])
    prop = Prop(
        name="staff",
        motion=_prop("staff", points, middle, turn),
        held_by=(Grip(0, "LeftWrist"), Grip(0, "RightWrist")),
    )
    touches = (
        contact((0, "LeftWrist"), (1, NEAREST), 0.0, t[-1]),
        contact((0, "RightWrist"), (1, NEAREST), 0.0, t[-1]),
    )
    return SampleScene({"performer": performer(t, body, reaches)}, touches, (prop,))


def sit_on_chair() -> SampleScene:
    """A person sits down on a chair, with the hands above the knees, and stays."""
    t = clock(DURATION)
    down = held(t, 0.2, 1.4, 9.0, 10.0)
    stooped = bump(t, 0.2, 1.5)
    body = trunk(
        columns(0.0, STANDING - 3 + down * (SEAT + 9.0 - STANDING + 3), -40.0 * held(t, 0.2, 1.3, 9.0, 10.0)),
        turned(pitch=3 - 8 * down + 30 * stooped),
        turned(pitch=2 + 4 * down + 12 * stooped + 2.0 * cosine(t, 1.1)),
        turned(pitch=3 + 10 * stooped),
    )
    feet = planted_feet(t, width=26, toe_out=10)
    seat = _grid(np.linspace(-19.4, 19.4, 5), [SEAT], np.linspace(-61, -23, 5))
    back = _grid([-20.0, 0.0, 20.0], [60.0, 75.0, 90.0], [-63.0])
    legs = _grid([-20.0, 20.0], [0.0], [-60.0, -24.0])
    prop = Prop(name="chair", motion=standing_prop("chair", np.concatenate([seat, back, legs])))
    touches = (contact((0, "LeftHip"), (1, NEAREST), 1.6, t[-1]),)
    above = hand(fingers=[-0.1, -0.2, 1.0], palm=[0.0, -1.0, -0.2])
    reaches = {
        "Left": Reach((13.0, SEAT + 18.0, -10.0), above, down, (0.8, -0.6, -0.3)),
        "Right": Reach((-13.0, SEAT + 18.0, -10.0), mirrored(above), down, (-0.8, -0.6, -0.3)),
    }
    return SampleScene({"performer": performer(t, body, reaches, feet)}, touches, (prop,))


def drum_on_table() -> SampleScene:
    """Both hands drum on a table, by turns."""
    t, period, start = clock(DURATION), 0.6, 0.7
    raised = held(t, 0.1, start - 0.2, 2.3, 2.6)
    body = trunk(
        columns(0.0, STANDING - 1.0 + 0 * t, 0.0),
        turned(pitch=4 + 0 * t),
        turned(pitch=6 + cosine(t, 0.3)),
        turned(pitch=14 + 0 * t),
    )
    reaches, touches = {}, []
    for side, sign, late in (("Left", 1.0, 0.0), ("Right", -1.0, period / 2)):
        strikes = [start + late + number * period for number in range(2)]
        up = 1.0 - sum(held(t, strike - 0.2, strike, strike + 0.06, strike + 0.25) for strike in strikes)
        place = columns(sign * 16.0, TABLE + WRIST_HEIGHT + 12 * up, 30.0)
        turn = flat_hand(6.0)
        reaches[side] = Reach(place, turn if side == "Left" else mirrored(turn), raised, (sign, -0.2, -0.5))
        touches += [contact((0, f"{side}Wrist_End"), (1, NEAREST), strike, strike + 0.06) for strike in strikes]
    top = _grid([-48.0, -16.0, 16.0, 48.0], [TABLE], [18.0, 47.0, 60.0])
    legs = _grid([-48.0, 48.0], [0.0], [18.0, 60.0])
    prop = Prop(name="table", motion=standing_prop("table", np.concatenate([top, legs])))
    return SampleScene({"performer": performer(t, body, reaches)}, tuple(touches), (prop,))


def standing_prop(name: str, points: np.ndarray) -> Motion:
    """A prop that stands still, with these points, (points, 3) [cm]."""
    return parse_obj(obj_text(points), f"{name}.obj")


def obj_text(points: np.ndarray) -> str:
    """The text of an OBJ file with these vertices, (points, 3)."""
    return "".join(f"v {x:.6f} {y:.6f} {z:.6f}\n" for x, y, z in points)


def _prop(name: str, points: np.ndarray, path: Track, turn: Rotation) -> Motion:
    """A prop of one joint with points fixed to it, (points, 3) [cm]."""
    count = len(points)
    skeleton = Skeleton(
        names=(name, *(f"{name}{number}" for number in range(1, count + 1))),
        parents=np.append(-1, np.zeros(count, np.intp)),
        offsets=np.concatenate([np.zeros((1, 3)), points]),
        channels=(POSITION_CHANNELS + ROTATION_CHANNELS, *[()] * count),
        end_sites=np.append(False, np.ones(count, bool)),
        units="cm",
        up="Y",
    )
    rotations = np.tile([0.0, 0.0, 0.0, 1.0], (len(path), count + 1, 1))
    rotations[:, 0] = turn.as_quat()
    return Motion(skeleton, path, rotations, FRAME_TIME)


def _grid(x: ArrayLike, y: ArrayLike, z: ArrayLike) -> np.ndarray:
    """(points, 3), all points with these coordinates."""
    return np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1).reshape(-1, 3).astype(float)


SCENES: dict[str, Callable[[], SampleScene]] = {
    scene.__name__: scene for scene in (handshake, high_five, waltz, lift, push, staff, sit_on_chair, drum_on_table)
}

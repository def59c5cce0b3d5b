"""The fingers below a hand, recognised by the names of their joints."""

from __future__ import annotations

import re
from collections.abc import Sequence

from distretarget.body.anatomy import FINGERS
from distretarget.body.joint_names import JointName
from distretarget.body.vocabulary import vocabulary

# A finger's number in a joint's name, and the number of a finger's last bone that has a role.
FINGER_NUMBER = re.compile(r"finger(\d)")
LAST_BONE = 3


def fingers_of(hand: int, parents: Sequence[int], names: Sequence[JointName]) -> dict[str, int]:
    """Return the joints of the fingers below a hand, by role without side, such as "Index1".

    `parents` and `names` have an entry per joint of the skeleton.
    """
    below = {hand}
    for joint in range(hand + 1, len(parents)):
        if parents[joint] in below:
            below.add(joint)
    stems = {joint: names[joint].stem for joint in sorted(below - {hand}) if not names[joint].helper}
    from_zero = any("finger0" in stem for stem in stems.values())
    joints: dict[str, list[int]] = {finger: [] for finger in FINGERS}
    next_finger: dict[int, str] = {}
    for joint in reversed(stems):
        finger = _finger_of(stems[joint], from_zero) or (next_finger.get(joint) if _in_palm(stems[joint]) else None)
        if finger:
            joints[finger].insert(0, joint)
            if finger != "Thumb":
                next_finger[parents[joint]] = finger
    return {
        f"{finger}{number}": joint
        for finger, chain in joints.items()
        for number, joint in enumerate(chain, start=_first_number(finger, [stems[joint] for joint in chain]))
        if number <= LAST_BONE
    }


def _finger_of(stem: str, from_zero: bool) -> str | None:
    """The finger that a stem names by a word, or by a number that counts from the thumb; None without either."""
    for finger, own_words in vocabulary().fingers.items():
        if any(word in stem for word in own_words):
            return finger
    number = FINGER_NUMBER.search(stem)
    return dict(enumerate(FINGERS, start=not from_zero)).get(int(number[1])) if number else None


def _in_palm(stem: str) -> bool:
    return any(word in stem for word in vocabulary().palm)


def _first_number(finger: str, stems: Sequence[str]) -> int:
    """The number of a finger's first bone: 0 for a bone in the palm, else 1.

    A bone is in the palm if its name says so, or if three others follow it and its number is not 1. A thumb of three
    bones begins in the palm, but with 1.
    """
    if not stems:
        return 1
    longer = len(stems) > LAST_BONE and not stems[0].endswith("1")
    return 0 if longer or (finger != "Thumb" and _in_palm(stems[0])) else 1

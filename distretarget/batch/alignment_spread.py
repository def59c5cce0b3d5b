"""How far the alignments of clips of one rig with one target differ, which should be the same.

Where a person cannot stand in a rig's rest pose, its motion decides how its joints are aligned with another rig's, and
what head, hands and feet do in a clip may become part of the alignment.
"""

from __future__ import annotations

import base64
import hashlib
import json
from collections import defaultdict
from collections.abc import Iterable, Iterator
from pathlib import PurePath

import numpy as np
from numpy.typing import NDArray

from distretarget.baseline.rotation_copy import rest_alignment
from distretarget.batch.record import ManifestRecord
from distretarget.body.anatomy import ARM, LEG, SIDES
from distretarget.matching.matching import Matching
from distretarget.numerics.vectors import angles_between, lengths, normalised
from distretarget.skeleton import Skeleton

Array = NDArray[np.float64]

ROLES = ("hips", "chest", "neck", "head", *(side + part for side in SIDES for part in (*ARM, *LEG)))
MOST = 8.0  # a larger spread is over the limit [degrees]
SCALE = 32767.0  # of quaternions as whole numbers


def alignment_text(matching: Matching) -> str:
    """Return the alignment of two matched bodies in few characters: a hash of the source's rig, and the rotation of
    each of `ROLES`; empty unless the target has an anatomy.
    """
    if matching.target.anatomy is None:
        return ""
    packed = np.round(SCALE * role_rotations(matching)).astype("<i2").tobytes()
    return f"{_rig(matching.source.skeleton)}:{base64.b64encode(packed).decode()}"


def role_rotations(matching: Matching) -> Array:
    """Return the rotation that aligns the joint of each of `ROLES`, (`ROLES`, 4); zero where there is none."""
    roles = matching.target.anatomy.roles if matching.target.anatomy else {}
    alignment, rotations = rest_alignment(matching)[:, 0], np.zeros((len(ROLES), 4))
    for k, role in enumerate(ROLES):
        if role in roles and matching.drivers[roles[role]] >= 0:
            rotations[k] = alignment[roles[role]]
    return rotations


def _rig(skeleton: Skeleton) -> str:
    """A hash of the names, the tree and the rest pose of a rig, which bodies of several sizes may have."""
    directions = np.round(normalised(skeleton.offsets[1:]), 1) + 0.0
    text = json.dumps([skeleton.names, skeleton.parents.tolist(), directions.tolist()])
    return hashlib.sha256(text.encode()).hexdigest()[:12]


def spread_warnings(records: Iterable[ManifestRecord]) -> Iterator[str]:
    """Yield a line for each rig and target whose alignments differ by more than `MOST`, from the lines of a batch."""
    groups: dict[tuple[str, ...], list[tuple[str, Array]]] = defaultdict(list)
    for record in records:
        rig, _, text = record["alignment"].partition(":")
        rotations = _unpacked(text)
        if rotations is not None:
            alike = rig, record["target"], record["target_hash"], json.dumps(record["options"])
            groups[alike].append((record["output"], rotations))
    for (_, target, *_), clips in groups.items():
        angle, role, one, other = largest_spread(np.array([rotations for _, rotations in clips]))
        if angle > MOST:
            yield (
                f"warning: {len(clips)} clips of one rig are aligned with {PurePath(target).name} in ways that differ "
                f"by up to {angle:.0f} degrees ({ROLES[role]}, {clips[one][0]} and {clips[other][0]}): nobody can "
                "stand in the rest pose, and each clip is aligned by its own motion"
            )


def _unpacked(text: str) -> Array | None:
    """The rotations, (`ROLES`, 4), of an alignment's text; None if it is not one."""
    try:
        return np.frombuffer(base64.b64decode(text, validate=True), "<i2").astype(float).reshape(len(ROLES), 4)
    except ValueError:
        return None


def largest_spread(rotations: Array) -> tuple[float, int, int, int]:
    """Return the largest angle between the rotations of a joint in two clips [degrees], the joint, and the clips.

    `rotations` are quaternions (clips, joints, 4), of any length, zero where unknown. Compared are all clips with the
    one that is farthest from the first, which finds at least half of the largest angle.
    """
    joints = np.arange(rotations.shape[1])
    one = _angles(rotations, rotations[0]).argmax(axis=0)
    angles = _angles(rotations, rotations[one, joints])
    other, joint = np.unravel_index(angles.argmax(), angles.shape)
    return float(angles[other, joint]), int(joint), int(one[joint]), int(other)


def _angles(rotations: Array, others: Array) -> Array:
    """(clips, joints), the angles between rotations, (clips, joints, 4), and others, (joints, 4) [degrees]."""
    known = (lengths(rotations) > 0) & (lengths(others) > 0)
    angles = angles_between(rotations, np.broadcast_to(others, rotations.shape))
    return np.asarray(np.where(known, np.degrees(2.0 * np.minimum(angles, np.pi - angles)), 0.0))

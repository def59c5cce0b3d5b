"""Other bodies made from a skeleton by its joints' names: the targets of the measurements."""

from __future__ import annotations

import re

import numpy as np

from distretarget import Skeleton

# The part of the body a bone belongs to, by the name of its lower joint; the first pattern that fits counts.
PARTS = [
    ("end", r"_end\d*$"),
    ("finger", r"finger|thumb|index|mid|ring|pinky|metacarpal"),
    ("toe", r"toe|metatarsal"),
    ("forearm", r"forearm|lowarm|lowerarm|elbow"),
    ("hand", r"hand|wrist"),
    ("upper arm", r"arm|shldr$|upperarm|humerus"),
    ("shoulder", r"shoulder|collar|clavicle"),
    ("shin", r"foot|ankle"),
    ("thigh", r"^(?!.*(up|thigh)).*leg|knee|shin|calf"),
    ("hip", r"upleg|thigh|upperleg|hip|buttock|pelvis\."),
    ("trunk", r"spine|back|abdomen|chest|neck|head|torso"),
]

"""Retarget a folder of clips to one skeleton, and save positions and 6D rotations of each for training.

python examples/data_set.py CLIPS TARGET.json ARRAYS
"""

import sys
from pathlib import Path

from distretarget import load_target, read_bvh, retarget, write_npz

clips, target, arrays = Path(sys.argv[1]), load_target(sys.argv[2]), Path(sys.argv[3])
arrays.mkdir(exist_ok=True)
for clip in sorted(clips.glob("*.bvh")):
    result = retarget(read_bvh(clip), target)
    write_npz(arrays / f"{clip.stem}.npz", result.motion, rotations="6d")

"""Print where the hands of a clip are, and how each joint turns, as numpy arrays.

python examples/arrays.py CLIP.bvh
"""

import sys

import numpy as np

from distretarget import Motion, read_bvh

motion: Motion = read_bvh(sys.argv[1])
arrays = motion.to_dict(rotations="matrix")
hands = [joint for joint, name in enumerate(arrays["names"]) if str(name).endswith(("Hand", "Wrist"))]
paths = arrays["positions"][:, hands]
print("hands:", arrays["names"][hands], "apart by", np.linalg.norm(paths[:, 0] - paths[:, -1], axis=-1).round(2))
print("local rotation matrices:", arrays["local_rotations"].shape, "at", 1 / arrays["frame_time"], "frames a second")

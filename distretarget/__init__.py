"""Retarget BVH motion to another body by normalised joint distances.

from distretarget import load_target, read_bvh, retarget, write_bvh

result = retarget(read_bvh("walk.bvh"), load_target("hero.json"))
write_bvh("walk_hero.bvh", result.motion)
"""

from distretarget.errors import DistretargetError
from distretarget.io.bvh import read_bvh
from distretarget.io.bvh_writer import write_bvh
from distretarget.io.target_file import load_target
from distretarget.motion import Motion
from distretarget.result import RetargetResult
from distretarget.retargeting import retarget
from distretarget.skeleton import Skeleton
from distretarget.solve.settings import ContactSettings

__all__ = [
    "ContactSettings",
    "DistretargetError",
    "Motion",
    "RetargetResult",
    "Skeleton",
    "load_target",
    "read_bvh",
    "retarget",
    "write_bvh",
]

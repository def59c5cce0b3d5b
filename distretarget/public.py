"""The public names of the package, which `distretarget` offers as its own."""

from distretarget.baseline.world import World
from distretarget.batch.batch import convert_folder
from distretarget.batch.manifest import ManifestRecord, Tally
from distretarget.body.anatomy import Anatomy
from distretarget.body.body import Body
from distretarget.errors import (
    BatchError,
    BvhError,
    DistretargetError,
    FileError,
    MapError,
    MatchingError,
    MissingPackageError,
    MotionError,
    SettingsError,
    SkeletonError,
    SkeletonFileError,
)
from distretarget.ik.spg import Effort
from distretarget.io.bvh import read_bvh
from distretarget.io.bvh_writer import write_bvh
from distretarget.io.interop import from_bvhio, to_bvhio, write_npz
from distretarget.io.target_file import load_target
from distretarget.matching.matching import Matching, match
from distretarget.measure.diff import Diff, diff
from distretarget.measure.figures import FIGURES, Figure
from distretarget.measure.metrics import Comparison
from distretarget.measure.scene_gaps import Gap, SceneDiff, diff_scenes
from distretarget.motion import Motion, MotionArrays, MovingBones
from distretarget.numerics.kinematics import forward_kinematics
from distretarget.objectives.settings import ContactSettings
from distretarget.objectives.supports import Supports
from distretarget.pipeline.options import Options
from distretarget.pipeline.result import RetargetResult
from distretarget.pipeline.retargeting import retarget
from distretarget.report.clip_page import write_report
from distretarget.report.diff_document import DiffDocument
from distretarget.report.run_summary import RunFiguresDocument
from distretarget.report.scene_page import write_scene_report
from distretarget.scene.props import Grip, Prop, PropResult, prop_of
from distretarget.scene.retargeting import SceneResult, retarget_scene
from distretarget.scene.scene_file import SceneSetup, load_scene
from distretarget.skeleton import Skeleton
from distretarget.target import SkeletonEdit, Target

__all__ = [
    "FIGURES",
    "Anatomy",
    "BatchError",
    "Body",
    "BvhError",
    "Comparison",
    "ContactSettings",
    "Diff",
    "DiffDocument",
    "DistretargetError",
    "Effort",
    "Figure",
    "FileError",
    "Gap",
    "Grip",
    "ManifestRecord",
    "MapError",
    "Matching",
    "MatchingError",
    "MissingPackageError",
    "Motion",
    "MotionArrays",
    "MotionError",
    "MovingBones",
    "Options",
    "Prop",
    "PropResult",
    "RetargetResult",
    "RunFiguresDocument",
    "SceneDiff",
    "SceneResult",
    "SceneSetup",
    "SettingsError",
    "Skeleton",
    "SkeletonEdit",
    "SkeletonError",
    "SkeletonFileError",
    "Supports",
    "Tally",
    "Target",
    "World",
    "convert_folder",
    "diff",
    "diff_scenes",
    "forward_kinematics",
    "from_bvhio",
    "load_scene",
    "load_target",
    "match",
    "prop_of",
    "read_bvh",
    "retarget",
    "retarget_scene",
    "to_bvhio",
    "write_bvh",
    "write_npz",
    "write_report",
    "write_scene_report",
]

"""All results of a batch as animations of one character file."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path

from distretarget.batch.plan import MANIFEST, METRICS, Clip
from distretarget.character.nodes import Animation
from distretarget.io.files import write_whole
from distretarget.io.input_file import load_file
from distretarget.io.motion_file import parse_motion
from distretarget.io.motion_writer import OutputSettings, character_animation, with_animations
from distretarget.io.target_file import TargetFile


def clips_folder(path: Path) -> Path:
    """Return the folder beside a file that keeps its clips as BVH, with a manifest, until the file is written; so an
    interrupted run continues where it stopped.
    """
    return path.with_name(f"{path.name}.clips")


def merge(path: Path, target: TargetFile, clips: Sequence[Clip], settings: OutputSettings, overwrite: bool) -> int:
    """Write the character file with an animation for each clip that is done, in the order of their names, and return
    how many; if all are done, the folder of clips goes, and its manifest and metrics stay beside the file.

    An animation has its clip's name, or in a tree of folders its path in it.

    Raises:
        DistretargetError: the file cannot be written.
    """
    folder = clips_folder(path)
    done = sorted(
        (clip for clip in clips if (folder / clip.place).is_file()), key=lambda clip: clip.place.with_suffix("")
    )
    animations = list(_animations(folder, done, target, settings))
    write_whole(path, with_animations(path, target, animations, settings.animations), overwrite)
    if len(done) == len(clips):
        for name in (MANIFEST, METRICS):
            with suppress(OSError):
                (folder / name).replace(path.with_name(f"{path.name}.{name}"))
        shutil.rmtree(folder, ignore_errors=True)
    return len(animations)


def _animations(
    folder: Path, clips: Sequence[Clip], target: TargetFile, settings: OutputSettings
) -> Iterator[Animation]:
    for clip in clips:
        motion, _ = parse_motion(load_file(folder / clip.place))
        yield character_animation(target, settings.clip(motion, clip.place.with_suffix("").as_posix()))

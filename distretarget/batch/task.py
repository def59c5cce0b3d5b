"""The conversion of one clip by a worker: texts in, texts and figures out, without access to files."""

from __future__ import annotations

import time
from collections.abc import Mapping
from concurrent.futures import BrokenExecutor, CancelledError
from dataclasses import dataclass, field, replace
from functools import cached_property
from importlib.metadata import version

from distretarget.errors import DistretargetError
from distretarget.ik.poses import Mapper
from distretarget.io.bvh import parse_bvh
from distretarget.io.bvh_writer import bvh_parts
from distretarget.io.files import Text, text_hash
from distretarget.io.map_json import MapFile
from distretarget.measure.figures import Variant
from distretarget.pipeline.options import Options
from distretarget.pipeline.retarget_files import retarget_onto
from distretarget.pipeline.summary import unmatched
from distretarget.report.document import About
from distretarget.report.report import run_page


@dataclass(frozen=True, kw_only=True)
class Task:
    """A clip to convert: the texts of all files it needs, the options, and what its report is to say, if any."""

    source: Text
    target: Text
    map: MapFile
    options: Options
    about: About | None = None


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """The outcome of a task.

    Attributes:
        version: the version of the program that did the task.
        seconds: how long it took [s].
        error: why it failed, one line; empty if it did not.
        bvh: the text of the output.
        frames: the number of frames of the output.
        figures: the figures of source, rotation copy and result.
        notes: what the manifest notes of any clip between these bodies, such as joints without a counterpart.
        warnings: what needs a look, a line each.
        report: the HTML of the report; empty if none was wanted.
    """

    version: str
    seconds: float = 0.0
    error: str = ""
    bvh: str = ""
    frames: int = 0
    figures: Mapping[Variant, Mapping[str, float | None]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    report: str = ""

    @cached_property
    def bvh_hash(self) -> str:
        """The hash of the output file."""
        return text_hash(self.bvh)


def convert(task: Task, mapper: Mapper = map) -> Outcome:
    """Convert a clip; the outcome says what went wrong, if anything did. `mapper` is as in `retarget`."""
    started = time.perf_counter()
    try:
        outcome = _converted(task, mapper)
    except DistretargetError as error:
        outcome = _failed(str(error))
    except (BrokenExecutor, CancelledError):  # raised by the mapper: the clip is not to blame
        raise
    except MemoryError:
        outcome = _failed(f"{task.source.path}: out of memory")
    except Exception as error:  # one clip must not stop the others
        outcome = _failed(f"{task.source.path}: unexpected {type(error).__name__}: {error}; please report this")
    return replace(outcome, seconds=time.perf_counter() - started)


def _failed(error: str) -> Outcome:
    return Outcome(version=version("distretarget"), error=" ".join(error.split()))


def _converted(task: Task, mapper: Mapper) -> Outcome:
    path = task.source.path
    motion = parse_bvh(task.source.text, path)
    result = retarget_onto(motion, task.target, source=path, map_file=task.map, options=task.options, mapper=mapper)
    parts = bvh_parts(result.motion, mapper)  # other workers, if the mapper has any, make them while figures are made
    return Outcome(
        version=version("distretarget"),
        report=run_page(result, task.about) if task.about else "",
        notes=tuple(unmatched(result.matching)),
        warnings=result.warnings,
        figures=result.figures,
        frames=len(result.motion),
        bvh="".join(parts),
    )

"""The job of retargeting one clip, which a worker does without access to files, and its result."""

from __future__ import annotations

import pickle
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import PurePath

from distretarget.batch.record import BatchRecord
from distretarget.batch.summary import alignment_text
from distretarget.character.nodes import Animation
from distretarget.contact_entries import NO_CONTACTS, ContactList
from distretarget.errors import DistretargetError
from distretarget.io.bvh_writer import python_refusals, refusals
from distretarget.io.files import encoded_parts
from distretarget.io.formats import OUTPUTS
from distretarget.io.input_file import InputFile
from distretarget.io.motion_writer import character_animation, content_of
from distretarget.io.target_file import TargetFile
from distretarget.matching.unmatched import others_without_source, parts_without_source
from distretarget.measure.metrics import in_columns
from distretarget.numerics.parallel import thread_limit
from distretarget.pipeline.conversion import Conversion, Recipe
from distretarget.report.clip_page import run_page
from distretarget.report.diff_document import About
from distretarget.report.page import VERSION

TIME_LIMITS = (0.001, 1e6)  # bounds of a job's time limit [s]

Output = bytes | Animation


@dataclass(frozen=True)
class Job:
    """A clip to retarget."""

    source: InputFile
    target: bytes  # a pickled `TargetFile`, which a worker unpickles once for all clips
    recipe: Recipe
    record: BatchRecord  # the record of the clip before it is done
    outputs: tuple[str, ...]  # paths of the results in the folder of results, the one in `record` first
    contacts: ContactList = NO_CONTACTS
    about: About | None = None  # for its report; None for no report
    time_limit: float | None = None  # after which the process is killed [s]
    threads: int | None = None  # for a long clip, which one core alone would finish after all others

    def failed(self, reason: str) -> Result:
        """Return the result of a clip that failed; the reason names the file."""
        return Result({**self.record, "error": " ".join(reason.split())})


@dataclass(frozen=True)
class Result:
    """The result of a job: the record and, if done, contents by path, of characters the animation, and its report."""

    record: BatchRecord
    outputs: Mapping[str, Output] = field(default_factory=dict)
    report: str = ""


@lru_cache(maxsize=4)
def target_of_job(target: bytes) -> TargetFile:
    """Return the target of a job, unpickled and cached."""
    file: TargetFile = pickle.loads(target)
    return file


def run(job: Job) -> Result:
    """Retarget a clip; an error is recorded in the result."""
    started = time.perf_counter()
    path = job.source.path
    if job.record["version"] != VERSION:
        return job.failed(f"{path}: a worker runs version {VERSION}, this is {job.record['version']}")
    try:
        with thread_limit(job.threads):
            result = _converted(job)
    except DistretargetError as error:
        result = job.failed(str(error))
    except MemoryError:
        result = job.failed(f"{path}: out of memory")
    except Exception as error:  # one clip must not stop the others
        result = job.failed(f"{path}: unexpected {type(error).__name__}: {error}; please report this")
    result.record["seconds"] = round(time.perf_counter() - started, 3)
    return result


def _converted(job: Job) -> Result:
    recipe, target = job.recipe, target_of_job(job.target)
    motion, lost = recipe.read(job.source)
    kinds = {name: OUTPUTS[PurePath(name).suffix] for name in job.outputs}
    name = PurePath(next(iter(kinds))).stem
    done = Conversion.of(motion, job.source, target, recipe).converted(name, (*kinds.values(),), job.contacts)
    result = done.result
    body = result.motion.skeleton
    refused = (*refusals(body), *python_refusals(body)) if "BVH" in kinds.values() else ()
    record: BatchRecord = {
        **job.record,
        "status": "done",
        "frames": len(result.motion),
        "metrics": in_columns(result.metrics),
        "verdict": result.verdict,
        "warnings": [*done.left_out(lost), *result.warnings],
        "notes": [*parts_without_source(result.matching), *others_without_source(result.matching), *refused],
        "alignment": alignment_text(result.matching),
    }
    outputs = {
        name: character_animation(target, done.clip)
        if kind == "character"
        else b"".join(encoded_parts(content_of(name, done.clip, target, recipe.writing)))
        for name, kind in kinds.items()
    }
    return Result(record, outputs, run_page(result, job.about, target.target, job.source) if job.about else "")

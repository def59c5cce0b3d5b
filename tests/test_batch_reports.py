"""The pages over the clips of a batch: where they are written, and which files they may replace."""

from pathlib import Path, PurePath

import pytest

from distretarget.batch.clips import Clip
from distretarget.batch.plan import Work
from distretarget.batch.reports import MARK, OF, Pages
from distretarget.batch.task import Outcome
from distretarget.errors import FileError
from distretarget.io.files import Text, text_hash
from distretarget.report.document import About


def work(name):
    return Work(Clip(Path(name), PurePath(name), 1), Text("{}", "hero.json"), PurePath(name))


def pages(folder, most=None, overwrite=False):
    return Pages(
        index=folder / "index.html",
        most=most,
        overwrite=overwrite,
        about=lambda _: About(a="a", b="b", command="", version="1"),
    )


def test_only_pages_of_a_batch_are_replaced(tmp_path):
    pages(tmp_path).check()
    (tmp_path / "index.html").write_text("my own")
    with pytest.raises(FileError, match="exists already; --overwrite replaces it"):
        pages(tmp_path).check()
    pages(tmp_path, overwrite=True).check()
    (tmp_path / "index.html").write_text(f"<html>{MARK}")
    pages(tmp_path).check()


def test_reports_have_the_places_of_outputs(tmp_path):
    own = pages(tmp_path)
    path = tmp_path / "index_reports" / "a" / "b.html"
    assert own.path(work("a/b.bvh")) == path
    for text in ("one", "two"):
        own.add(work("a/b.bvh"), Outcome(version="1", bvh=text, report=f"{MARK} {text}"))
    assert path.read_text() == f"{MARK}{OF.format(text_hash('two'))} two"
    assert not own.problems
    path.write_text("my own")
    own.add(work("a/b.bvh"), Outcome(version="1", report=MARK))
    assert [str(problem) for problem in own.problems.values()] == [f"{path}: exists already; --overwrite replaces it"]
    assert path.read_text() == "my own"


def test_a_page_needs_a_folder_that_can_be_written_to(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(FileError, match="nothing can be written to"):
        pages(tmp_path / "file").check()
    pages(tmp_path / "new" / "deep").check()

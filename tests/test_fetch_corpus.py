"""The command that fetches the clips of the benchmarks."""

from pathlib import Path

import fetch_corpus
import pytest
from click.testing import CliRunner
from clips import CLIPS


@pytest.fixture
def published(tmp_path):
    """A folder that is served like the repositories, without the last file; and the names of all."""
    names = []
    for name, address in fetch_corpus.addresses(str(tmp_path / "host")):
        Path(address).parent.mkdir(parents=True, exist_ok=True)
        Path(address).write_text(name, "utf-8")
        names.append(name)
    Path(address).unlink()
    return (tmp_path / "host").as_uri(), names


def test_every_clip_of_the_tables_is_published():
    assert {clip for clip in CLIPS if "/" in clip} <= {name for name, _ in fetch_corpus.addresses()}


def test_all_that_is_there_is_fetched_once_and_what_is_not_is_named(tmp_path, published):
    host, names = published
    folder = tmp_path / "corpus"
    done = CliRunner().invoke(fetch_corpus.main, [str(folder), "--host", host])
    assert done.exit_code == 1
    assert names[-1].rpartition("/")[2].removesuffix(".bvh") in done.output
    assert "1 files could not be fetched" in done.output
    assert [(folder / name).read_text("utf-8") for name in names[:-1]] == names[:-1]
    assert not (folder / names[-1]).exists()
    (folder / names[0]).write_text("own", "utf-8")
    again = CliRunner().invoke(fetch_corpus.main, [str(folder), "--host", host])
    assert "0 files fetched" in again.output
    assert (folder / names[0]).read_text("utf-8") == "own"

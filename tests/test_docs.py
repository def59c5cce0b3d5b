"""The manual: the reference is up to date, links lead to files, and every example runs."""

import re
import shlex
import shutil
from dataclasses import fields
from pathlib import Path

import make_settings
import pytest
from bodies import SAMPLES
from make_reference import PAGE, reference
from program import run

from distretarget.solve.settings import ContactSettings

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted([*ROOT.glob("*.md"), *ROOT.glob("docs/*.md")])
WITH_EXAMPLES = [page for page in PAGES if page.name != "CONTRIBUTING.md"]
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", re.MULTILINE | re.DOTALL)
PROGRAM = re.compile(r"(?:^|\.venv/bin/)distretarget (.+)$")


def each(pages):
    return pytest.mark.parametrize("page", pages, ids=lambda page: page.name)


def run_line(line):
    """Run a shell line of an example if it calls the program; any other line has to be in `.ci/run`."""
    found = PROGRAM.search(line)
    if not found:
        assert line in (ROOT / ".ci" / "run").read_text().splitlines()
        return
    done = run(*shlex.split(found[1]))
    assert done.returncode == 0, f"{line}: {done.stderr or done.stdout}"


def run_block(language, text, names):
    if language == "sh":
        for line in text.splitlines():
            run_line(line)
    elif language == "python":
        exec(compile(text, "example", "exec"), names)


def test_the_reference_is_up_to_date():
    assert PAGE.read_text("utf-8") == reference(), "run tools/make_reference.py"


def test_the_table_of_settings_is_up_to_date_and_has_every_setting():
    text = make_settings.PAGE.read_text("utf-8")
    assert text == make_settings.page(text), "run tools/make_settings.py"
    assert [name for name, *_ in make_settings.rows()] == [field.name for field in fields(ContactSettings)]


@each(WITH_EXAMPLES)
def test_every_example_runs(page, tmp_path, monkeypatch):
    shutil.copytree(SAMPLES, tmp_path / SAMPLES.name)
    monkeypatch.chdir(tmp_path)
    names = {}
    for language, text in BLOCK.findall(page.read_text("utf-8")):
        run_block(language, text, names)


@each(PAGES)
def test_links_lead_to_files(page):
    for link in re.findall(r"\]\(([^)#]+)[^)]*\)", page.read_text("utf-8")):
        assert link.startswith("https://") or (page.parent / link).exists(), link


def test_the_front_page_is_short():
    assert len((ROOT / "README.md").read_text().splitlines()) <= 100

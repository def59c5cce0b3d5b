"""Template, style and scripts of the report: complete, without unused parts, with short lines."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

import distretarget.report
from distretarget.report.page import SCRIPTS

FOLDER = Path(distretarget.report.__file__).parent
TEMPLATE, STYLE = ((FOLDER / name).read_text("utf-8") for name in ("template.html", "style.css"))
SOURCES = {
    path.name: path.read_text("utf-8")
    for path in sorted(FOLDER.glob("*.js"))
    if path.name not in ("index.js", "together.js")
}
SCRIPT = "\n".join(SOURCES[name] for name in SCRIPTS)
CODE = re.sub(r"/\*.*?\*/|^\s*//[^\n]*", "", SCRIPT, flags=re.DOTALL | re.MULTILINE)  # without comments
IDS = set(re.findall(r'\bid="([\w-]+)"', TEMPLATE))
RULES = re.sub(r"\{[^{}]*\}", "{}", re.sub(r"/\*.*?\*/", "", STYLE, flags=re.DOTALL))  # without declarations


def words(text):
    return set(re.findall(r"[\w$-]+", text))


def test_every_script_is_in_the_page():
    assert set(SCRIPTS) == set(SOURCES)


@pytest.mark.parametrize("name", ["head.html", "template.html", "style.css", *SOURCES])
def test_lines_are_short_and_end_in_no_space(name):
    for number, line in enumerate((FOLDER / name).read_text("utf-8").splitlines(), 1):
        assert len(line) <= 120, f"{name}:{number}"
        assert line == line.rstrip(), f"{name}:{number}"
        assert "\t" not in line, f"{name}:{number}"


@pytest.mark.parametrize("name", SOURCES)
def test_a_script_can_be_read(name):
    if not (node := shutil.which("node")):
        pytest.skip("node, which reads the scripts, is not installed")
    done = subprocess.run([node, "--check", FOLDER / name], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_every_name_of_a_script_is_used_and_has_one_meaning():
    names = re.findall(r"^(?:function|const|let|class) ([\w$]+)", CODE, re.MULTILINE)
    names += [
        name for pair in re.findall(r"^const ([\w$]+) = .*, ([\w$]+) = ", CODE, re.MULTILINE) for name in pair[1:]
    ]
    assert len(names) == len(set(names)) > 60
    for name in names:
        assert len(re.findall(rf"(?<![\w$])(?<!\w\.){re.escape(name)}(?![\w$])", CODE)) > 1, name


def test_scripts_use_the_ids_of_the_template_and_the_template_has_no_other():
    asked = set(re.findall(r"\$\('([\w-]+)'\)", CODE)) | set(re.findall(r"(?<!\.)(?:toggle|look)\('([\w-]+)'", CODE))
    assert asked <= IDS
    named = set(re.findall(r'(?:for|aria-labelledby|aria-describedby)="([\w-]+)"|href="#([\w-]+)"', TEMPLATE))
    named = {name for pair in named for name in pair if name}
    assert named <= IDS
    assert asked | named | set(re.findall(r"#([\w-]+)", RULES)) >= IDS
    assert len(re.findall(r'\bid="', TEMPLATE)) == len(IDS)


def test_the_style_has_no_class_that_nothing_has():
    there = words(TEMPLATE) | words(CODE) | {f"{stem}-{name}" for stem in ("of", "bar") for name in "ab"}
    assert set(re.findall(r"\.([a-z][\w-]*)", RULES)) <= there
    assert set(re.findall(r"#([\w-]+)", RULES)) <= IDS


def test_what_has_a_class_has_a_style():
    given = re.findall(r"class(?:: |=)['\"]([\w -]+)['\"]", TEMPLATE + CODE)
    assert {name for text in given for name in text.split()} <= words(RULES)


def test_colours_are_used_and_both_themes_have_them():
    light, *dark = (set(re.findall(r"--([\w-]+):", block)) for block in re.findall(r":root[^{]*\{([^{}]*)\}", STYLE))
    assert len(dark) == 2
    assert light == dark[0] == dark[1]
    (read,) = re.findall(r"const COLOURS = \[(.*?)\];", CODE, re.DOTALL)
    used = set(re.findall(r"var\(--([\w-]+)\)", STYLE)) | set(re.findall(r"'(\w+)'", read))
    assert light == used
    for name in re.findall(r"'(\w+)'", read):
        assert re.search(rf"colour\.{name}\b|'{name}'", CODE.replace(read, "")), name


def test_both_dark_themes_are_the_same():
    first, second = (re.sub(r"\s+", " ", text) for text in re.findall(r"\{\s*(color-scheme: dark;[^}]*)\}", STYLE))
    assert first == second

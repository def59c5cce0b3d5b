"""Templates, styles and scripts of the pages: complete, without unused parts, with short lines."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

import distretarget.report
from distretarget.report.page import SCRIPTS, STYLES

FOLDER = Path(distretarget.report.__file__).parent
KINDS = ("clip", "index", "scene")
FILES = {
    path.name: path.read_text("utf-8") for path in sorted(FOLDER.iterdir()) if path.suffix in (".html", ".css", ".js")
}
TEMPLATE = {kind: FILES["page.html"] + FILES[f"{kind}.html"] for kind in KINDS}
CODE = {  # without comments
    name: re.sub(r"/\*.*?\*/|^\s*//[^\n]*", "", text, flags=re.DOTALL | re.MULTILINE)
    for name, text in FILES.items()
    if name.endswith(".js")
}
RULES = {  # without comments and declarations
    name: re.sub(r"\{[^{}]*\}", "{}", re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL))
    for name, text in FILES.items()
    if name.endswith(".css")
}
DATA = {"clip": {"document", "drawing", "registry"}, "index": {"batch", "registry"}, "scene": {"scene"}}
STYLE = FILES["style.css"]


def words(text):
    return set(re.findall(r"[\w$-]+", text))


def code_of(kind):
    return "\n".join(CODE[name] for name in SCRIPTS[kind])


def rules_of(kind):
    return "\n".join(RULES[name] for name in STYLES[kind])


def ids_of(kind):
    return re.findall(r'\bid="([\w-]+)"', TEMPLATE[kind])


def asked_by(code):
    return set(re.findall(r"\$\('([\w-]+)'\)", code)) | set(re.findall(r"(?<!\.)(?:toggle|look)\('([\w-]+)'", code))


def names_in(code):
    names = re.findall(r"^(?:function|const|let|class) ([\w$]+)", code, re.MULTILINE)
    pairs = re.findall(r"^const ([\w$]+) = .*, ([\w$]+) = ", code, re.MULTILINE)
    return names + [name for pair in pairs for name in pair[1:]]


def test_every_file_belongs_to_a_page():
    assert {name for names in SCRIPTS.values() for name in names} == set(CODE)
    assert {name for names in STYLES.values() for name in names} == set(RULES)
    assert {f"{kind}.html" for kind in KINDS} | {"page.html", *CODE, *RULES} == set(FILES)


@pytest.mark.parametrize("name", FILES)
def test_lines_are_short_and_end_in_no_space(name):
    for number, line in enumerate(FILES[name].splitlines(), 1):
        assert len(line) <= 120, f"{name}:{number}"
        assert line == line.rstrip(), f"{name}:{number}"
        assert "\t" not in line, f"{name}:{number}"


@pytest.mark.parametrize("name", CODE)
def test_a_script_can_be_read(name):
    if not (node := shutil.which("node")):
        pytest.skip("node, which reads the scripts, is not installed")
    done = subprocess.run([node, "--check", FOLDER / name], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("kind", KINDS)
def test_every_name_of_a_page_has_one_meaning(kind):
    names = names_in(code_of(kind))
    assert len(names) == len(set(names)) > 40
    assert code_of(kind).count("'use strict';") == 1


@pytest.mark.parametrize("name", CODE)
def test_every_name_of_a_script_is_used(name):
    pages = [code_of(kind) for kind in KINDS if name in SCRIPTS[kind]]
    for word in names_in(CODE[name]):
        used = rf"(?<![\w$])(?<!\w\.){re.escape(word)}(?![\w$])"
        assert max(len(re.findall(used, code)) for code in pages) > 1, word


@pytest.mark.parametrize("kind", KINDS)
def test_scripts_use_the_ids_of_the_template_and_the_template_has_no_other(kind):
    ids, code = ids_of(kind), code_of(kind)
    assert len(ids) == len(set(ids))
    not_base = "\n".join(CODE[name] for name in SCRIPTS[kind] if name != "base.js")
    assert asked_by(not_base) <= {*ids, *DATA[kind]}
    named = re.findall(r'(?:for|aria-labelledby|aria-describedby)="([\w-]+)"|href="#([\w-]+)"', TEMPLATE[kind])
    named = {name for pair in named for name in pair if name}
    assert named <= set(ids)
    assert asked_by(code) | named | set(re.findall(r"#([\w-]+)", rules_of(kind))) >= {*ids, *DATA[kind]}
    assert asked_by(code) >= DATA[kind]


@pytest.mark.parametrize("name", RULES)
def test_a_style_has_no_class_and_no_id_that_nothing_has(name):
    kinds = [kind for kind in KINDS if name in STYLES[kind]]
    there = {word for kind in kinds for word in words(TEMPLATE[kind] + code_of(kind))}
    there |= {f"{stem}-{letter}" for stem in ("of", "bar") for letter in "ab"}
    assert set(re.findall(r"\.([a-z][\w-]*)", RULES[name])) <= there
    assert set(re.findall(r"#([\w-]+)", RULES[name])) <= {one for kind in kinds for one in ids_of(kind)}


@pytest.mark.parametrize("kind", KINDS)
def test_what_has_a_class_has_a_style(kind):
    given = re.findall(r"class(?:: |=)['\"]([\w -]+)['\"]", TEMPLATE[kind] + code_of(kind))
    assert {name for text in given for name in text.split()} <= words(rules_of(kind))


def test_colours_are_used_and_both_themes_have_them():
    code = code_of("clip")
    light, *dark = (set(re.findall(r"--([\w-]+):", block)) for block in re.findall(r":root[^{]*\{([^{}]*)\}", STYLE))
    assert len(dark) == 2
    assert light == dark[0] == dark[1]
    (read,) = re.findall(r"const COLOURS = \[(.*?)\];", code, re.DOTALL)
    used = set(re.findall(r"var\(--([\w-]+)\)", STYLE)) | set(re.findall(r"'(\w+)'", read))
    assert light == used
    for name in re.findall(r"'(\w+)'", read):
        assert re.search(rf"colour\.{name}\b|'{name}'", code.replace(read, "")), name


def test_both_dark_themes_are_the_same():
    first, second = (re.sub(r"\s+", " ", text) for text in re.findall(r"\{\s*(color-scheme: dark;[^}]*)\}", STYLE))
    assert first == second

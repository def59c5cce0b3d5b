"""Hooks of MkDocs for the site: pages of the project's root, links to other files, and formulas.

Pages of the root (README.md, CHANGELOG.md, ...) become pages of the site, README.md the first. Links to files that are
no pages lead to the repository. Formulas become MathML, which browsers draw without scripts.
"""

from __future__ import annotations

import html
import posixpath
import re
import tomllib
from pathlib import Path

from math_core import LatexToMathML
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parents[1]
REPOSITORY = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["urls"]["Source"]
ROOT_PAGES = {
    path.name: "index.md" if path.stem == "README" else path.name.lower() for path in sorted(ROOT.glob("*.md"))
}
LINK = re.compile(r"""(\]\(|(?:src|srcset|href)=")([^)"\s:#]+)""")
FORMULA = re.compile(r'<(span|div) class="arithmatex">\\[(\[](.*?)\\[)\]]</\1>', re.DOTALL)


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """List the pages of the root, but the first page, at the end of the navigation."""
    config.nav.append({"Project": [page for page in ROOT_PAGES.values() if page != "index.md"]})
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages of the root."""
    for name, page in ROOT_PAGES.items():
        files.append(File.generated(config, page, content=(ROOT / name).read_text("utf-8")))
    return files


def on_page_markdown(markdown: str, page: Page, **_: object) -> str:
    """Turn links that are right in the repository into links that are right on the site."""
    folder = "" if page.file.src_uri in ROOT_PAGES.values() else "docs"

    def led(link: re.Match[str]) -> str:
        path = posixpath.normpath(posixpath.join(folder, link[2]))
        if path in ROOT_PAGES:
            return link[1] + ROOT_PAGES[path]
        if path.startswith("docs/"):
            return link[1] + path.removeprefix("docs/")
        return f"{link[1]}{REPOSITORY}/blob/main/{path}"

    return LINK.sub(led, markdown)


def on_page_content(content: str, **_: object) -> str:
    """Turn formulas into MathML."""
    return FORMULA.sub(_mathml, content)


def _mathml(formula: re.Match[str]) -> str:
    element, text = formula[1], html.unescape(formula[2]).strip()
    mathml = LatexToMathML().convert_with_local_state(text, displaystyle=element == "div")
    return f'<{element} class="formula">{mathml}</{element}>'

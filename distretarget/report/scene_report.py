"""The report on a scene, or on the diff of two: an HTML file with all performers and props in one player."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path

from distretarget.checks import check_kind
from distretarget.errors import SettingsError
from distretarget.io.files import write_whole
from distretarget.measure.scene_gaps import SceneDiff
from distretarget.report.document import About, document
from distretarget.report.scene_diff import scene_document
from distretarget.report.scene_diff_page import scene_diff_page
from distretarget.report.scene_page import scene_page
from distretarget.scene.retargeting import SceneResult


def write_scene_report(
    path: str | Path,
    compared: SceneResult | SceneDiff,
    names: Sequence[str],
    *,
    a_name: str = "A",
    b_name: str = "B",
    overwrite: bool = False,
) -> None:
    """Write the report on a scene or on the diff of two: one HTML file that any browser opens, without a network.

    `names` are those of the performers, and then of the props. `a_name` and `b_name` are what the report of a diff
    calls the two scenes.

    Raises:
        FileError: the file exists and `overwrite` is false, or it cannot be written.
        SettingsError: `compared` is something else, or there are not as many different names as performers and props.
    """
    check_kind("compared", compared, SceneResult, SceneDiff)
    performers = len(compared.results if isinstance(compared, SceneResult) else compared.performers)
    count = performers + len(compared.props)
    if len(names) != count or len({*names}) != count:
        raise SettingsError(f"names is {list(names)}; expected {count} different names, performers before props")
    if isinstance(compared, SceneResult):
        html = scene_page(compared, names)
    else:
        about = About(a=a_name, b=b_name, command="", version=version("distretarget"))
        pairs = zip(names[:performers], compared.performers, strict=True)
        documents = {name: document(one, about) for name, one in pairs}
        html = scene_diff_page(compared, scene_document(compared, documents, names[performers:], about))
    write_whole(path, html, overwrite)

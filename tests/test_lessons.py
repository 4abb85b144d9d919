"""The lessons and the gallery run from top to bottom, and what they say and show comes out.

Cells that carry the tag `check` hold what is asserted of the figures in the text; pages leave them
out.
"""

from __future__ import annotations

import ast
import json
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import pytest
from IPython.core.formatters import DisplayFormatter

ROOT = Path(__file__).resolve().parent.parent
LESSONS = sorted((ROOT / "docs" / "lessons").glob("*.ipynb"))
GALLERY = ROOT / "docs" / "gallery.ipynb"


@pytest.mark.filterwarnings("ignore:stick_slip. numbers that are unlikely")
@pytest.mark.parametrize("lesson", [*LESSONS, GALLERY], ids=lambda path: path.stem)
@pytest.mark.slow
def test_a_lesson_runs(lesson: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(plt, "show", lambda: None)
    names: dict[str, object] = {"__name__": "__main__"}
    for cell in json.loads(lesson.read_text(encoding="utf-8"))["cells"]:
        if cell["cell_type"] == "code":
            shown = outcome("".join(cell["source"]), f"{lesson.name} {cell['id']}", names)
            if shown is not None:
                kinds = DisplayFormatter().format(shown)[0]
                assert "image/png" in kinds, f"{cell['id']} shows no picture but {shown}"
    plt.close("all")


def outcome(source: str, place: str, names: dict[str, Any]) -> Any:
    """Value of the expression in which a cell ends, which a notebook shows."""
    lines = ast.parse(source)
    last = lines.body.pop() if isinstance(lines.body[-1], ast.Expr) else None
    exec(compile(lines, place, "exec"), names)
    if last is None:
        return None
    return eval(compile(ast.Expression(last.value), place, "eval"), names)  # type: ignore[attr-defined]


def test_there_are_lessons_in_the_navigation_without_results() -> None:
    """Pictures come from the build of the pages, so that they are of this version."""
    navigation = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    assert len(LESSONS) == 7
    for lesson in (*LESSONS, GALLERY):
        assert f"- {lesson.relative_to(ROOT / 'docs').as_posix()}\n" in navigation
        cells = json.loads(lesson.read_text(encoding="utf-8"))["cells"]
        assert not any(cell.get("outputs") for cell in cells)

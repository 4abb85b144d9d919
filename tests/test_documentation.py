"""Every Python block of the README and of the documentation runs, in order, page by page.

The reference describes every public name once, and its first page leads there.
"""

from __future__ import annotations

import pkgutil
import re
import runpy
from pathlib import Path
from types import SimpleNamespace

import pytest
from public_names import public_names

from heelstrike.robot import Robot, SpatialRobot
from heelstrike.robot.named_tree import NamedTree

ROOT = Path(__file__).resolve().parent.parent
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
SOME_SLOW = [PAGES[0], *(pytest.param(page, marks=pytest.mark.slow) for page in PAGES[1:])]
BLOCK = re.compile(r"^```python[^\n]*\n(.*?)^```$", re.DOTALL | re.MULTILINE)


@pytest.mark.parametrize("page", SOME_SLOW, ids=lambda path: str(path.relative_to(ROOT)))
def test_code_blocks_run(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)  # what a block writes does not stay
    text = page.read_text(encoding="utf-8")
    names: dict[str, object] = {"__name__": "__main__"}
    for block in BLOCK.finditer(text):
        # Blank lines in front make a traceback name the line of the page.
        code = "\n" * text.count("\n", 0, block.start(1)) + block[1]
        exec(compile(code, str(page), "exec"), names)


def test_the_reference_is_that_of_the_public_names() -> None:
    described = {
        f"reference/{page.name}#{name}"
        for page in (ROOT / "docs" / "reference").glob("*.md")
        for name in re.findall(r"^::: (\S+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    }
    assert sorted(each.partition("#")[2] for each in described) == sorted(public_names())
    index = (ROOT / "docs" / "reference.md").read_text(encoding="utf-8")
    assert sorted(re.findall(r"\((reference/\S+#\S+)\)", index)) == sorted(described)


@pytest.mark.parametrize("kind", [Robot, SpatialRobot])
def test_the_reference_shows_what_all_robots_have(kind: type[NamedTree]) -> None:
    """Members that are inherited appear where the page lists them."""
    page = (ROOT / "docs" / "reference" / "robots.md").read_text(encoding="utf-8")
    block = rf"^::: heelstrike\.{kind.__name__}\n +options:\n +inherited_members: \[(.*)\]$"
    listed = re.findall(block, page, re.MULTILINE)[0].split(", ")
    shared = {name for name in vars(NamedTree) if not name.startswith("_")}
    assert sorted(listed) == sorted(shared - set(vars(kind)))


def test_links_to_names_lead_to_what_is_described() -> None:
    """The strict build asks the same of every link, and of names that are described in place."""
    docs = ROOT / "docs"
    with_places = runpy.run_path(str(docs / "places.py"))["on_page_markdown"]
    for page in docs.glob("*.md"):
        built = SimpleNamespace(file=SimpleNamespace(src_uri=page.name))
        text = with_places(page.read_text(encoding="utf-8"), built)
        here = set(re.findall(r"^::: (\S+)$", text, re.MULTILINE))
        for name in here:
            pkgutil.resolve_name(name)
        for target, name in re.findall(r"\]\(([^)#]*)#(heelstrike\.[^)]+)\)", text):
            described = (docs / target).read_text(encoding="utf-8") if target else text
            assert f"::: {name}\n" in described, f"{page.name}: {name}"


def test_rows_of_tables_have_a_head() -> None:
    """Rows after a blank line are shown as text."""
    lost = []
    for page in PAGES:
        text = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.M | re.S)
        for table in re.findall(r"(?:^\|.*$\n?)+", text, re.MULTILINE):
            first, *rows = table.splitlines()
            if not rows or not re.fullmatch(r"[|: -]+", rows[0]):
                lost.append(f"{page.name}: {first[:60]}")
    assert lost == []


def test_every_page_is_in_the_navigation() -> None:
    docs = ROOT / "docs"
    pages = {str(page.relative_to(docs).as_posix()) for page in docs.rglob("*.md")}
    navigation = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    assert sorted(re.findall(r"^ +- (?:\w+: )?(\S+\.md)$", navigation, re.MULTILINE)) == sorted(
        pages
    )

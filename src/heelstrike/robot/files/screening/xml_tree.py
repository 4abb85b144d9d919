"""XML text as a tree, in the plain reading that robot files need, and a tree as text again.

Python's own reader refuses a tag like ``<gazebo:plugin>`` whose prefix nothing declares, which
robot files are full of; it builds trees so deep that nothing can walk them, and it replaces
entities until the memory is full.
"""

from __future__ import annotations

import re
from contextlib import suppress
from pathlib import Path
from typing import NoReturn
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat
from xml.sax.saxutils import quoteattr

from heelstrike.errors import RobotError

DEEPEST = 400
"""Most elements inside one another; MuJoCo's parser takes 500."""

MOST_ELEMENTS = 20_000
"""Most elements of a robot, copies included; the largest we know has some 2000."""


WRITTEN = ("sdf", "robot")
"""Roots of formats in which something stands between tags."""

_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)


class Node(Element):
    """An element that knows where it was written.

    Attributes
    ----------
    line : int
        Line of the main file on which it begins, or that of the ``<include>`` that brought it.
    folder : Path or None
        Folder of the file that it was included from, None if it is in the main file.
    merged : bool
        Whether it is an SDF model that becomes a part of the one that includes it.
    """

    line = 0
    folder: Path | None = None
    merged = False


def xml_tree(text: str, label: str) -> Node:
    """Return the tree of an XML text.

    The text between its tags is kept in SDF and URDF only, for elsewhere it means nothing. Prefixes
    of tags stay in the tags.

    Raises
    ------
    RobotError
        If the text is not well-formed XML, with line and column; if it is nested too deeply, has
        too many elements, or declares a document type or entities.
    """
    try:
        return _tree(text, label)
    except RobotError:
        # Two hyphens in a comment, which XML forbids and everybody writes.
        bare = _COMMENT.sub(lambda found: "\n" * found.group().count("\n"), text)
        if bare == text:
            raise
        with suppress(RobotError):
            return _tree(bare, label)
        raise


def _tree(text: str, label: str) -> Node:
    builder: TreeBuilder = TreeBuilder(element_factory=Node)
    depth = count = 0
    written = False

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth, count, written
        depth += 1
        count += 1
        written = written or (depth == 1 and tag in WRITTEN)
        if depth > DEEPEST:
            refuse(f"more than {DEEPEST} elements inside one another, which no robot needs.")
        if count > MOST_ELEMENTS:
            refuse(f"more than {MOST_ELEMENTS} elements, which no robot needs.")
        builder.start(tag, attributes).line = parser.CurrentLineNumber  # type: ignore[attr-defined]

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    def words(text: str) -> None:
        if written:
            builder.data(text)

    def declaration(*_: object) -> None:
        refuse(
            "a document type or entity declaration, which no robot needs and which can make a "
            "parser read other files or fill the memory. Remove it."
        )

    def refuse(what: str) -> NoReturn:
        raise RobotError(f"{label}: line {parser.CurrentLineNumber}: {what}")

    parser = expat.ParserCreate("utf-8")
    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = words
    parser.StartDoctypeDeclHandler = declaration
    parser.EntityDeclHandler = declaration
    try:
        parser.Parse(text.encode("utf-8", "surrogatepass"), True)
    except expat.ExpatError as error:
        raise RobotError(
            f"{label}: this is not well-formed XML: {expat.ErrorString(error.code)} at line "
            f"{error.lineno}, column {error.offset + 1}. Is the file complete?"
        ) from error
    root: Node = builder.close()  # type: ignore[assignment]
    return root


def xml_text(root: Element) -> str:
    """Return the text of a tree, every element on its line where that is possible.

    What a parser says about a line is then true of the file that the tree was read from.
    """
    parts: list[str] = []
    line = 1
    stack: list[Element | str] = [root]
    while stack:
        element = stack.pop()
        if isinstance(element, str):
            parts.append(element)
            continue
        missing = getattr(element, "line", 0) - line
        if missing > 0:
            parts.append("\n" * missing)
            line += missing
        attributes = "".join(f" {key}={quoteattr(text)}" for key, text in element.attrib.items())
        if len(element):
            parts.append(f"<{element.tag}{attributes}>")
            stack.append(f"</{element.tag}>")
            stack.extend(reversed(element))
        else:
            parts.append(f"<{element.tag}{attributes}/>")
    return "".join(parts)

"""XML text as a tree, in the plain reading that robot files need.

Python's own reader refuses a tag like ``<gazebo:plugin>`` whose prefix nothing declares, which
robot files are full of, and it builds trees so deep that nothing can walk them.
"""

from __future__ import annotations

from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from heelstrike.errors import RobotError

DEEPEST = 400
"""Most elements inside one another; MuJoCo's parser takes 500."""


def xml_tree(text: str, label: str) -> Element:
    """Return the tree of an XML text. Prefixes of tags stay in the tags.

    Raises
    ------
    RobotError
        If the text is not well-formed XML, with line and column, or nested too deeply.
    """
    builder = TreeBuilder()
    depth = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > DEEPEST:
            raise RobotError(
                f"{label}: line {parser.CurrentLineNumber}: more than {DEEPEST} elements inside "
                "one another, which no robot needs."
            )
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    parser = expat.ParserCreate("utf-8")
    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = builder.data
    try:
        parser.Parse(text.encode("utf-8", "surrogatepass"), True)
    except expat.ExpatError as error:
        raise RobotError(
            f"{label}: this is not well-formed XML: {expat.ErrorString(error.code)} at line "
            f"{error.lineno}, column {error.offset + 1}. Is the file complete?"
        ) from error
    return builder.close()

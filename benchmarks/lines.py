"""Lines of the package, room by room: those of code, and all.

A line of code is one that holds a token of the program: no blank line, comment or docstring, and
no text beneath a field. Whoever makes an idea one sees here what that saved:

    python benchmarks/lines.py
    python benchmarks/lines.py --depth 2
"""

from __future__ import annotations

import argparse
import ast
import tokenize
from collections import Counter
from pathlib import Path

PACKAGE = Path(__file__).parent.parent / "src" / "heelstrike"
NOTHING = {
    *(tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT),
    *(tokenize.ENCODING, tokenize.ENDMARKER),
}
"""Kinds of tokens that are no code."""


def code_lines(path: Path) -> int:
    """Count the lines of code of a file."""
    with path.open("rb") as file:
        tokens = [each for each in tokenize.tokenize(file.readline) if each.type not in NOTHING]
    lines = {line for each in tokens for line in range(each.start[0], each.end[0] + 1)}
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        match node:
            case ast.Expr(value=ast.Constant(value=str())):
                lines -= set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return len(lines)


def counted(depth: int) -> dict[str, tuple[int, int]]:
    """Count lines of code, and all, by the first parts of the names of files."""
    code: Counter[str] = Counter()
    every: Counter[str] = Counter()
    for path in sorted(PACKAGE.rglob("*.py")):
        room = "/".join(path.relative_to(PACKAGE).parts[:depth])
        code[room] += code_lines(path)
        every[room] += len(path.read_text(encoding="utf-8").splitlines())
    return {room: (code[room], every[room]) for room, _ in code.most_common()}


def main() -> None:
    """Print them, the largest room first."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--depth", type=int, default=1, help="folders that count by themselves")
    rooms = counted(parser.parse_args().depth)
    for room, (code, every) in rooms.items():
        print(f"{code:7} {every:7}  {room}")
    print(f"{sum(c for c, _ in rooms.values()):7} {sum(e for _, e in rooms.values()):7}  in all")


if __name__ == "__main__":
    main()

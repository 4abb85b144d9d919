"""Small wrongs that a line of Python can suffer, each a replacement of text."""

from __future__ import annotations

import ast
import math
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path


@dataclass(frozen=True)
class Mutant:
    """A file with one piece of text replaced by another.

    Attributes
    ----------
    file : str
        Path below the package.
    line : int
        Line of the text, from 1.
    function : int
        First line of the function it is in, 0 for none.
    scope : str
        Name of that function.
    begin, end : int
        Where the text is, in characters from the beginning of the file.
    old, new : str
        The text and what stands there instead.
    kind : str
        Name of the operator.
    """

    file: str
    line: int
    function: int
    scope: str
    begin: int
    end: int
    old: str
    new: str
    kind: str

    @property
    def name(self) -> str:
        """What tells it from all others."""
        return f"{self.file}:{self.line}:{self.begin}:{self.kind}:{self.new}"

    def apply(self, text: str) -> str:
        """Return the contents of the file with this one wrong in it."""
        if text[self.begin : self.end] != self.old:
            raise ValueError(f"{self.file}:{self.line} is not what it was")
        return text[: self.begin] + self.new + text[self.end :]


ARITHMETIC: dict[type[ast.operator], str] = {
    ast.Add: "-",
    ast.Sub: "+",
    ast.Mult: "/",
    ast.Div: "*",
}
COMPARISONS: dict[type[ast.cmpop], tuple[str, ...]] = {
    ast.Lt: ("<=", ">"),
    ast.LtE: ("<", ">="),
    ast.Gt: (">=", "<"),
    ast.GtE: (">", "<="),
    ast.Eq: ("!=",),
    ast.NotEq: ("==",),
    ast.Is: ("is not",),
    ast.IsNot: ("is",),
    ast.In: ("not in",),
    ast.NotIn: ("in",),
}
SYMBOLS: dict[type[ast.AST], str] = {
    ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Lt: "<", ast.LtE: "<=",
    ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!=", ast.Is: "is", ast.IsNot: "is not",
    ast.In: "in", ast.NotIn: "not in", ast.And: "and", ast.Or: "or",
}  # fmt: skip
TWINS = {
    "min": "max", "max": "min", "minimum": "maximum", "maximum": "minimum", "argmin": "argmax",
    "argmax": "argmin", "any": "all", "all": "any", "sin": "cos", "cos": "sin", "floor": "ceil",
}  # fmt: skip

# Where a number or a sign is a matter of words, types or looks.
UNHEEDED_CALLS = ("TypeVar", "namedtuple", "lru_cache", "field", "type_of", "cast", "getLogger")
UNHEEDED_FUNCTIONS = (
    "__repr__",
    "compiled_advance",
    "example_model",
    "_signature",
    "__reduce__",
)


class _Finder(ast.NodeVisitor):
    def __init__(self, file: str, text: str) -> None:
        self.file = file
        self.text = text
        self.found: list[Mutant] = []
        self.function = 0
        self.scope = ""
        # Positions of Python's parser are in bytes of UTF-8.
        self.lines = [line.encode() for line in text.splitlines(keepends=True)]
        self.starts = [0]
        for line in text.splitlines(keepends=True):
            self.starts.append(self.starts[-1] + len(line))

    def place(self, line: int, column: int) -> int:
        return self.starts[line - 1] + len(self.lines[line - 1][:column].decode())

    def span(self, node: ast.AST) -> tuple[int, int]:
        return (
            self.place(node.lineno, node.col_offset),  # type: ignore[attr-defined]
            self.place(node.end_lineno, node.end_col_offset),  # type: ignore[attr-defined]
        )

    def add(self, line: int, begin: int, end: int, new: str, kind: str) -> None:
        old = self.text[begin:end]
        where = self.file, line, self.function, self.scope
        self.found.append(Mutant(*where, begin, end, old, new, kind))

    def replace(self, node: ast.AST, new: str, kind: str) -> None:
        self.add(node.lineno, *self.span(node), new, kind)  # type: ignore[attr-defined]

    def between(self, left: ast.AST, right: ast.AST, symbol: str, new: str, kind: str) -> None:
        """Replace an operator, which stands between two operands."""
        begin, end = self.span(left)[1], self.span(right)[0]
        where = self.text.find(symbol, begin, end)
        if where >= 0:
            line = self.text.count("\n", 0, where) + 1
            self.add(line, where, where + len(symbol), new, kind)

    # Names, types, words.

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        if node.name in UNHEEDED_FUNCTIONS:
            return
        outer = self.function, self.scope
        self.function, self.scope = node.lineno, node.name
        if node.decorator_list:
            self.function = node.decorator_list[0].lineno
        for default in [*node.args.defaults, *filter(None, node.args.kw_defaults)]:
            self.visit(default)
        for statement in node.body:
            self.visit(statement)
        self.function, self.scope = outer

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        if any(isinstance(base, ast.Name) and base.id == "Protocol" for base in node.bases):
            return
        for statement in node.body:
            self.visit(statement)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.drop(node)
            self.visit(node.value)

    def visit_If(self, node: ast.If) -> None:
        if isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
            return
        self.negate(node.test)
        self.generic_visit(node)

    def visit_While(self, node: ast.While) -> None:
        if not isinstance(node.test, ast.Constant):
            self.generic_visit(node)
        else:
            for statement in node.body:
                self.visit(statement)

    def visit_Raise(self, node: ast.Raise) -> None:
        if node.exc is not None:
            self.replace(node, "pass", "drop a refusal")

    def visit_Assert(self, node: ast.Assert) -> None:
        pass

    def visit_Subscript(self, node: ast.Subscript) -> None:
        self.generic_visit(node)

    def visit_JoinedStr(self, node: ast.JoinedStr) -> None:
        pass

    # Operators.

    def visit_BinOp(self, node: ast.BinOp) -> None:
        kind = type(node.op)
        text = isinstance(node.left, ast.JoinedStr | ast.Constant) and not isinstance(
            getattr(node.left, "value", 0), int | float
        )
        if kind in ARITHMETIC and not text:
            self.between(node.left, node.right, SYMBOLS[kind], ARITHMETIC[kind], "arithmetic")
        self.generic_visit(node)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        kind = type(node.op)
        if kind in ARITHMETIC:
            symbol = SYMBOLS[kind] + "="
            new = ARITHMETIC[kind] + "="
            self.between(node.target, node.value, symbol, new, "arithmetic")
        self.drop(node)
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        if isinstance(node.op, ast.USub) and not isinstance(node.operand, ast.Constant):
            self.replace(node, self.text[slice(*self.span(node.operand))], "sign")
        if isinstance(node.op, ast.Not):
            self.replace(node, self.text[slice(*self.span(node.operand))], "negation")
        self.generic_visit(node)

    def visit_Compare(self, node: ast.Compare) -> None:
        left = node.left
        for operation, right in zip(node.ops, node.comparators, strict=True):
            for new in COMPARISONS.get(type(operation), ()):
                self.between(left, right, SYMBOLS[type(operation)], new, "comparison")
            left = right
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        symbol, new = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
        for left, right in pairwise(node.values):
            self.between(left, right, symbol, new, "and/or")
        self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        value = node.value
        if isinstance(value, bool):
            self.replace(node, str(not value), "constant")
        elif isinstance(value, int):
            self.replace(node, str(value + 1), "off by one")
        elif isinstance(value, float):
            if value == 0.0:
                self.replace(node, "1.0", "constant")
            elif math.isfinite(value):
                self.replace(node, repr(2.0 * value), "factor")

    def visit_Call(self, node: ast.Call) -> None:
        called = node.func
        name = getattr(called, "id", getattr(called, "attr", ""))
        if name in UNHEEDED_CALLS or name.endswith("Error"):
            return
        if name in TWINS:
            end = self.span(called)[1]
            self.add(called.end_lineno or 0, end - len(name), end, TWINS[name], "twin function")
        places = [a for a in node.args if isinstance(a, ast.Name | ast.Attribute | ast.Subscript)]
        for first, second in pairwise(places):
            if type(first) is not type(second):
                continue
            one, other = (self.text[slice(*self.span(a))] for a in (first, second))
            if one != other and first.lineno == second.end_lineno:
                begin, end = self.span(first)[0], self.span(second)[1]
                between = self.text[self.span(first)[1] : self.span(second)[0]]
                self.add(first.lineno, begin, end, other + between + one, "arguments exchanged")
        self.generic_visit(node)

    # Statements.

    def drop(self, node: ast.stmt) -> None:
        if self.function and not isinstance(getattr(node, "value", None), ast.Constant):
            self.replace(node, "pass", "statement dropped")

    def negate(self, test: ast.expr) -> None:
        if not isinstance(test, ast.Compare | ast.BoolOp | ast.UnaryOp):
            self.replace(test, f"(not {self.text[slice(*self.span(test))]})", "negation")

    def visit_Assign(self, node: ast.Assign) -> None:
        subscripted = any(isinstance(t, ast.Subscript | ast.Attribute) for t in node.targets)
        if subscripted:  # a name that is not assigned is an error anyone sees
            self.drop(node)
        if any(isinstance(t, ast.Name) and t.id in ("__all__", "SETTINGS") for t in node.targets):
            return
        for target in node.targets:
            self.visit(target)
        self.visit(node.value)

    def visit_Expr(self, node: ast.Expr) -> None:
        if isinstance(node.value, ast.Constant):
            return  # a docstring
        self.drop(node)
        self.visit(node.value)

    def visit_Continue(self, node: ast.Continue) -> None:
        self.replace(node, "break", "jump")

    def visit_Break(self, node: ast.Break) -> None:
        self.replace(node, "continue", "jump")


def mutants_of(package: Path, file: Path) -> list[Mutant]:
    """All mutants of a file, some of which may not be Python or no change."""
    text = file.read_text()
    finder = _Finder(str(file.relative_to(package)), text)
    finder.visit(ast.parse(text))
    return list({mutant.name: mutant for mutant in finder.found}.values())


def is_a_change(mutant: Mutant, text: str) -> bool:
    """Whether a mutant is Python, and not the same to the parser."""
    try:
        changed = ast.parse(mutant.apply(text))
    except SyntaxError:
        return False
    return ast.dump(changed) != ast.dump(ast.parse(text))

"""HTML from text: names come from files, and none of them may be taken for markup."""

from __future__ import annotations

import base64
import hashlib
import html
import json
from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any


def escaped(text: object) -> str:
    """Text as HTML shows it, in an element or between the quotes of an attribute."""
    return html.escape(str(text), quote=True)


def table(rows: Mapping[str, str] | Sequence[tuple[str, str]], caption: str = "") -> str:
    """Table of labels and values."""
    head = f"<caption>{escaped(caption)}</caption>" if caption else ""
    lines = (
        f'<tr><th scope="row">{escaped(label)}</th><td>{escaped(value)}</td></tr>'
        for label, value in (rows.items() if isinstance(rows, Mapping) else rows)
    )
    return f"<table>{head}<tbody>{''.join(lines)}</tbody></table>"


def grid(heading: Sequence[str], rows: Sequence[Sequence[str]], caption: str = "") -> str:
    """Table with a heading over its columns, whose first one names the rows."""
    head = f"<caption>{escaped(caption)}</caption>" if caption else ""
    top = "".join(f'<th scope="col">{escaped(cell)}</th>' for cell in heading)
    lines = []
    for first, *others in rows:
        cells = "".join(f"<td>{escaped(cell)}</td>" for cell in others)
        lines.append(f'<tr><th scope="row">{escaped(first)}</th>{cells}</tr>')
    return f"<table>{head}<thead><tr>{top}</tr></thead><tbody>{''.join(lines)}</tbody></table>"


def data_block(name: str, content: Any) -> str:
    """Element that holds JSON for a script; nothing in it can end the element."""
    text = json.dumps(content, separators=(",", ":"), allow_nan=False)
    safe = text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")
    return f'<script type="application/json" id="{escaped(name)}">{safe}</script>'


def shipped(name: str) -> str:
    """Text of a script or style sheet of this package."""
    return files(__package__).joinpath(name).read_text(encoding="utf-8")


def document(
    title: str, body: str, *, style: str, script: str = "", connect: str = "'none'"
) -> str:
    """One HTML file that asks for nothing: only its own script and style sheet are allowed.

    The policy names both by their digests, so that neither markup that slipped into a name nor
    another script could run or send anything.

    Parameters
    ----------
    title : str
        Of the page, as plain text.
    body : str
        Markup.
    style, script : str
        Style sheet, behind the one that all pages share, and script.
    connect : str
        What the script may talk to, as a content security policy has it.
    """
    style = shipped("style.css") + style
    policy = (
        f"default-src 'none'; img-src data:; connect-src {connect}; "
        f"style-src '{_digest(style)}'; script-src {_digest_or_none(script)}; "
        "base-uri 'none'; form-action 'none'"
    )
    ending = f"<script>{script}</script>\n" if script else ""
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="color-scheme" content="light dark">\n'
        '<link rel="icon" href="data:,">\n'
        f"<title>{escaped(title)}</title>\n<style>{style}</style>\n</head>\n"
        f"<body>\n{body}\n{ending}</body>\n</html>\n"
    )


def player(title: str, parts: Mapping[str, str], content: Any, script: str) -> str:
    """One HTML file that plays a run.

    Parameters
    ----------
    title : str
        Of the page, as plain text.
    parts : mapping of str to str
        Markup of what stands around the player, by the names that ``player.html`` has for it.
    content : Any
        What the script shows, as JSON has it.
    script : str
        What draws it.
    """
    body = shipped("player.html")
    for name, part in parts.items():
        body = body.replace(f"<!--{name}-->", part)
    script += shipped("player.js")
    return document(
        title, body + data_block("run", content), style=shipped("page.css"), script=script
    )


def _digest(text: str) -> str:
    return f"sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}"


def _digest_or_none(script: str) -> str:
    return f"'{_digest(script)}'" if script else "'none'"

"""What the functions a page leads to say of themselves, at its end, in the order of the page."""

from __future__ import annotations

import re
from typing import Any

PAGE = "how-a-step-works.md"

PLACE = """

::: {}
    options:
      heading_level: 3
      show_root_full_path: true
      show_signature: false
      members: false
"""


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Describe each place to which the page leads by its full name."""
    if page.file.src_uri != PAGE:
        return markdown
    places = dict.fromkeys(re.findall(r"\(#(heelstrike\.[\w.]+)\)", markdown))
    return markdown + "".join(map(PLACE.format, places))

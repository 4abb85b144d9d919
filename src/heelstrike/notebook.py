"""What notebooks show of an object: the one way up from the rooms where objects are at home."""

from __future__ import annotations


class ShownInNotebooks:
    """Base of what a notebook shows as a small table with a picture."""

    __slots__ = ()

    def _repr_html_(self) -> str:
        from heelstrike.view.notebook.cards import card

        return card(self)

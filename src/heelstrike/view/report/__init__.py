"""Runs judged on one page: the verdict first, figures, tables, where they come from."""

from heelstrike.view.report.writing import report

__all__ = ["report"]

"""The files of the zoo beside its results: CSV, a page, a figure."""

from __future__ import annotations

from pathlib import Path

from heelstrike.errors import ViewError
from heelstrike.experiments.zoo.figure import draw_zoo
from heelstrike.experiments.zoo.results import Results
from heelstrike.experiments.zoo.table import as_csv, as_page
from heelstrike.view.style import save_figure
from heelstrike.whole_file import check_target, write_whole

KINDS = (".svg", ".png", ".pdf")


class Targets:
    """Where the files of the zoo go; asked for before anything takes long.

    Parameters
    ----------
    folder : Path
        Created if it does not exist.
    page, figure : Path
        The page and the figure in it.

    Raises
    ------
    WriteError, ViewError
        If one of them cannot be written.
    OSError
        If the folder cannot be created.
    """

    def __init__(self, folder: Path, page: Path, figure: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.table, self.page, self.figure = folder / "zoo.csv", page, figure
        for path in (folder / "zoo.json", self.table, page, figure):
            check_target(path)
        if figure.suffix.lower() not in KINDS:
            raise ViewError(
                f"cannot write {figure}: the name of a figure ends in .svg, .png or .pdf"
            )

    def write(self, results: Results, command: str) -> tuple[Path, ...]:
        """Write everything that `command` found.

        Raises
        ------
        WriteError, ViewError
            If a file cannot be written.
        """
        text = as_page(results, page=self.page, figure=self.figure, command=command)
        return (
            write_whole(self.table, as_csv(results)),
            save_figure(draw_zoo(results), self.figure),
            write_whole(self.page, text),
        )

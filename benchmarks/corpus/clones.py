"""The files of the table, out of clones of their repositories.

Only what a row names is taken: the folder of the robot with its meshes, at the commit of the row.
What a clone lacks (large files kept elsewhere) is left out, as a reader would find it.
"""

from __future__ import annotations

import csv
import json
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

TABLE = Path(__file__).with_name("robots.csv")


@dataclass(frozen=True)
class Published:
    """One robot file that somebody has published.

    Attributes
    ----------
    repository : str
        ``owner/name`` on GitHub.
    commit : str
        The commit that holds it.
    folder : str
        Folder of the repository with all that the file refers to; empty for the whole repository.
    path : str
        The file, from the root of the repository.
    kind : str
        ``planar``, loaded as it is, or ``spatial``, loaded with ``projected=True``.
    options : str
        Further options of `load_robot`, as JSON.
    """

    repository: str
    commit: str
    folder: str
    path: str
    kind: str
    options: str = ""

    @property
    def link(self) -> str:
        """The repository, and a link to the file in it, as Markdown."""
        address = f"https://github.com/{self.repository}/blob/{self.commit}/{self.path}"
        return f"{self.repository} [{self.path.split('/')[-1]}]({address.replace(' ', '%20')})"

    def how(self) -> dict[str, Any]:
        """Options of `load_robot` for this file."""
        options: dict[str, Any] = {"projected": True} if self.kind == "spatial" else {}
        if self.path.endswith(".xacro"):
            options["xacro"] = True
        return options | (json.loads(self.options) if self.options else {})


def published() -> list[Published]:
    """Return the table."""
    with TABLE.open(newline="", encoding="utf-8") as file:
        return [Published(**row) for row in csv.DictReader(file)]


def row(*cells: str) -> str:
    """Return a row of a Markdown table."""
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def extracted(robot: Published, clones: Path, scratch: Path) -> Path:
    """Return the path of a robot file, taken out of a clone with its folder.

    Parameters
    ----------
    robot : Published
        What is wanted.
    clones : Path
        Folder of clones, ``owner+name`` or ``owner/name`` each. A missing one is fetched by git.
    scratch : Path
        Folder that takes the files; what is there stays.
    """
    owner, name = robot.repository.split("/")
    # The name of a package is often that of its repository.
    root = scratch / owner / robot.commit[:12] / name
    done = root / f".{robot.folder.replace('/', '+')}.done"
    if not done.exists():
        _write(_git_directory(clones, owner, name), robot, root)
        done.touch()
    return root / robot.path


def _git_directory(clones: Path, owner: str, name: str) -> Path:
    for clone in (clones / f"{owner}+{name}", clones / owner / name):
        for folder in (clone / ".git", clone, clone / "repo" / ".git", clone / "repo"):
            if (folder / "objects").is_dir():
                return folder
    clone = clones / owner / name
    address = f"https://github.com/{owner}/{name}.git"
    subprocess.run(
        ["git", "clone", "--quiet", "--bare", "--filter=blob:none", address, str(clone)], check=True
    )
    return clone


def _write(repository: Path, robot: Published, root: Path) -> None:
    git = ["git", f"--git-dir={repository}"]
    listing = subprocess.run(
        [*git, "ls-tree", "-r", "-z", robot.commit, "--", robot.folder or "."],
        check=True,
        capture_output=True,
    ).stdout
    for entry in filter(None, listing.split(b"\0")):
        about, _, path = entry.partition(b"\t")
        mode, kind, digest = about.decode().split()
        if kind != "blob" or mode == "120000":
            continue
        blob = subprocess.run([*git, "cat-file", "blob", digest], capture_output=True, check=False)
        if blob.returncode == 0:
            file = root / path.decode(errors="surrogateescape")
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(blob.stdout)

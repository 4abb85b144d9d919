"""Where the outcomes of a campaign are kept, block by block, so that nothing is lost or done twice.

They lie in one SQLite database. A block is one transaction: a killed process, a full disk or a
power cut leave all of it or nothing. A trial is known by a digest of its inputs, which is its key.
"""

from __future__ import annotations

import json
import math
import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path
from typing import Any

from heelstrike.errors import SimulationError, WriteError
from heelstrike.experiments.campaigns.outcome import Outcome

DATABASE, LOCK = "campaign.sqlite", "campaign.lock"
"""Files in the folder of a campaign; the second is locked while one is running."""

VERSION = 1
"""Of the tables."""

COLUMNS = tuple(each.name for each in fields(Outcome))
_KINDS = {"str": "TEXT", "bool": "INTEGER", "int": "INTEGER", "float": "REAL"}


class Store:
    """The outcomes in a folder.

    Parameters
    ----------
    folder : Path
        The folder; it is made if there is none.

    Raises
    ------
    SimulationError
        If what lies there is no campaign, or another process is running one.
    WriteError
        If it cannot be written to.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise WriteError(f"cannot write {folder}: {error.strerror or error}") from error
        self._lock = self._locked()
        with self._told():
            self._database = _opened(folder)
            kinds = ", ".join(f'"{each.name}" {_KINDS[str(each.type)]}' for each in fields(Outcome))
            with self._database as connection:
                connection.execute(
                    "CREATE TABLE IF NOT EXISTS about (name TEXT PRIMARY KEY, text TEXT)"
                )
                connection.execute(
                    "CREATE TABLE IF NOT EXISTS trials (inputs BLOB PRIMARY KEY, number INTEGER, "
                    f"{kinds}) WITHOUT ROWID"
                )

    def begin(
        self, about: Mapping[str, str], description: Mapping[str, str], *, afresh: bool
    ) -> None:
        """Begin a campaign, or go on with the same one.

        Parameters
        ----------
        about : mapping of str to str
            What decides about its trials, by name.
        description : mapping of str to str
            What else is to be known of it.
        afresh : bool
            Forget what was there.

        Raises
        ------
        SimulationError
            If the folder has another campaign.
        """
        with self._told(), self._database as connection:
            if afresh:
                connection.execute("DELETE FROM about")
                connection.execute("DELETE FROM trials")
            refuse_another(connection, about, self.folder)
            every = {**description, **about}
            connection.executemany("INSERT OR REPLACE INTO about VALUES (?, ?)", every.items())

    def known(self) -> dict[bytes, Outcome]:
        """Return the outcomes that are there, by the digests of their inputs."""
        with self._told():
            return outcomes_in(self._database)

    def keep(
        self, digests: Sequence[bytes], numbers: Sequence[int], outcomes: Sequence[Outcome]
    ) -> None:
        """Keep the outcomes of a block, all of them or none."""
        marks = ", ".join("?" * (2 + len(COLUMNS)))
        rows = [
            (digest, number, *_row(outcome))
            for digest, number, outcome in zip(digests, numbers, outcomes, strict=True)
        ]
        with self._told(), self._database as connection:
            connection.executemany(f"INSERT OR REPLACE INTO trials VALUES ({marks})", rows)

    def close(self) -> None:
        """Let go of the folder."""
        self._database.close()
        self._lock.close()

    def _locked(self) -> sqlite3.Connection:
        """Hold a lock, which the system itself lets go when this process ends, however it does."""
        lock = sqlite3.connect(self.folder / LOCK, timeout=0.0, isolation_level=None)
        try:
            lock.execute("BEGIN EXCLUSIVE")
        except sqlite3.OperationalError as error:
            lock.close()
            if "locked" in str(error):
                raise SimulationError(
                    f"another process is running the campaign in {self.folder}: wait for it, or "
                    "end it and start again"
                ) from None
            raise WriteError(f"cannot write {self.folder / LOCK}: {error}") from error
        except sqlite3.DatabaseError as error:
            lock.close()
            raise SimulationError(f"{self.folder / LOCK} is not ours ({error})") from error
        return lock

    @contextmanager
    def _told(self) -> Iterator[None]:
        with told(self.folder):
            yield


@contextmanager
def told(folder: Path, *, reads: bool = False) -> Iterator[None]:
    """Turn what the database says into words."""
    path = folder / DATABASE
    try:
        yield
    except sqlite3.OperationalError as error:
        if reads:
            raise SimulationError(
                f"{path} cannot be read: {error}. If its campaign was killed, only who may write "
                "there can open it; ask for the right to, or copy the folder"
            ) from error
        raise WriteError(
            f"cannot write {path}: {error}. What was finished is kept; the same command goes on"
        ) from error
    except sqlite3.DatabaseError as error:
        raise SimulationError(f"{path} is damaged, or no campaign: {error}") from error


@contextmanager
def reading(folder: Path) -> Iterator[sqlite3.Connection]:
    """Open the database of a folder to be read, while a campaign is running, too.

    Raises
    ------
    SimulationError
        If there is none.
    """
    if not (folder / DATABASE).is_file():
        raise SimulationError(f"{folder} has no campaign: there is no {DATABASE} in it")
    with told(folder, reads=True):
        connection = _readable((folder / DATABASE).resolve().as_uri())
        try:
            yield connection
        finally:
            connection.close()


def _readable(address: str) -> sqlite3.Connection:
    """Open a database whose last writer may have been killed: only who may write can undo that."""
    connection = sqlite3.connect(f"{address}?mode=rw", uri=True)
    try:
        connection.execute("SELECT count(*) FROM about")
        return connection
    except sqlite3.OperationalError:  # a folder that cannot be written to
        connection.close()
        return sqlite3.connect(f"{address}?mode=ro", uri=True)


def about_in(connection: sqlite3.Connection) -> dict[str, str]:
    """Return what decides about the trials of a campaign, by name."""
    return dict(connection.execute("SELECT name, text FROM about"))


def refuse_another(connection: sqlite3.Connection, about: Mapping[str, str], folder: Path) -> None:
    """Refuse a folder that has another campaign.

    Raises
    ------
    SimulationError
        That names what is other.
    """
    there = about_in(connection)
    differing = [name for name, text in about.items() if there.get(name, text) != text]
    if differing:
        raise SimulationError(
            f"{folder} has another campaign: its {' and '.join(differing)} "
            f"{'was' if len(differing) == 1 else 'were'} other. Ask for the same to go on with it, "
            "for another folder, or to start again (afresh=True)"
        )


def outcomes_in(connection: sqlite3.Connection) -> dict[bytes, Outcome]:
    """Return outcomes by the digests of their inputs."""
    names = ", ".join(f'"{name}"' for name in COLUMNS)
    return {
        row[0]: _outcome(row[1:])
        for row in connection.execute(f"SELECT inputs, {names} FROM trials")
    }


def _opened(folder: Path) -> sqlite3.Connection:
    connection = sqlite3.connect(folder / DATABASE)
    (version,) = connection.execute("PRAGMA user_version").fetchone()
    if version not in (0, VERSION):
        connection.close()
        raise SimulationError(
            f"{folder / DATABASE} is of version {version}, which is not known here; was it written "
            "by a newer heelstrike?"
        )
    connection.execute(f"PRAGMA user_version = {VERSION}")
    return connection


def _row(outcome: Outcome) -> tuple[Any, ...]:
    return tuple(getattr(outcome, name) for name in COLUMNS)  # what is no number is NULL


def _outcome(row: Sequence[Any]) -> Outcome:
    values = dict(zip(COLUMNS, row, strict=True))
    for each in fields(Outcome):
        if each.type == "float" and values[each.name] is None:
            values[each.name] = math.nan
    return Outcome(**values | {"success": bool(values["success"])})


def as_text(value: Any) -> str:
    """Return a description as text that is the same whenever it is the same."""
    return json.dumps(value, sort_keys=True, default=repr)

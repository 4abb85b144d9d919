"""Files of arrays by name, as NumPy's ``.npz``: written whole, read as from a stranger."""

from __future__ import annotations

import io
import os
import struct
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from heelstrike.errors import HeelstrikeError
from heelstrike.whole_file import write_whole

DAMAGED = (
    ValueError, KeyError, AttributeError, TypeError, EOFError, RuntimeError, OverflowError,
    MemoryError, AssertionError, zipfile.BadZipFile, zlib.error, struct.error,
)  # fmt: skip
"""What reading an archive raises when its bytes are others."""


def write_arrays(path: str | os.PathLike[str], arrays: Mapping[str, ArrayLike]) -> Path:
    """Write arrays to a file, by custom ``.npz``, which appears whole or not at all.

    Parameters
    ----------
    path : str or path
        The file; an existing one is replaced.
    arrays : mapping of str to array
        What is written; of objects none.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    WriteError
        If it cannot be written.
    """
    image = io.BytesIO()
    with zipfile.ZipFile(image, "w") as archive:
        for name, array in arrays.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array(member, np.asarray(array), allow_pickle=False)
    return write_whole(path, image.getbuffer())


def read_arrays(
    path: str | os.PathLike[str], what: str, error: type[HeelstrikeError],
    most: int | None = None,
) -> dict[str, NDArray[Any]]:  # fmt: skip
    """Read arrays from a file; nothing in it is executed.

    Parameters
    ----------
    path : str or path
        The file.
    what : str
        What it is to be, in words, as ``"a policy"``.
    error : type
        What is raised if it is not.
    most : int, optional
        Bytes that the arrays may have in all.

    Returns
    -------
    dict
        The arrays.

    Raises
    ------
    HeelstrikeError
        Of the type `error`, if there is no such file, or it is damaged or too large.
    """
    try:
        if most is not None:
            with zipfile.ZipFile(Path(path)) as archive:
                if sum(each.file_size for each in archive.infolist()) > most:
                    raise error(f"{path}: too large for {what}")
        with np.load(Path(path), allow_pickle=False) as file:
            return {name: file[name] for name in file.files}
    except OSError as trouble:
        raise error(f"{path}: cannot be read ({trouble.strerror or trouble})") from trouble
    except DAMAGED as trouble:
        raise error(f"{path}: not {what}, or damaged") from trouble

"""From an LLVM module to functions that can be called, kept on disk for the next time."""

from __future__ import annotations

import hashlib
import os
import sys
import tempfile
import threading
from collections.abc import Callable, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
from llvmlite import ir
from numba import config

from heelstrike.compilation import cache_directory
from heelstrike.fingerprint import fingerprint

_DIGEST = 32  # bytes
_OPTIMISATION = 1  # more costs time and gains nothing on straight-line code

_loaded: dict[str, Any] = {}
"""Engines by key. They hold the code, and live as long as the process."""

_loading = threading.Lock()
"""Held while an engine is made: a second one of the same key would take the first one's place."""


def can_fuse() -> bool:
    """Whether this processor multiplies and adds in one instruction."""
    return llvm.get_process_triple().startswith(("aarch64", "arm64")) or "+fma" in (
        _processor()[1].split(",")
    )


@lru_cache(maxsize=1)
def _processor() -> tuple[str, str]:
    """Name and features of the processor to compile for, as Numba has them."""
    settings: Any = config
    name = settings.CPU_NAME or llvm.get_host_cpu_name()
    features = settings.CPU_FEATURES
    if features is None:
        features = "" if settings.CPU_NAME else llvm.get_host_cpu_features().flatten()
    return name, features


def addresses(
    names: Sequence[str], described: bytes, write: Callable[[], ir.Module]
) -> tuple[int, ...]:
    """Return the addresses of the functions of a module, which is compiled if it is new.

    Parameters
    ----------
    names : sequence of str
        Names of the functions.
    described : bytes
        What the module depends on besides what its writer is made of, and the processor.
    write : callable
        Writes the module. What it is made of is the text of its Python module, and all that this
        names.
    """
    key = _key(described, write)
    with _loading:
        if key not in _loaded:
            _loaded[key] = _engine(key, write)
        return tuple(_loaded[key].get_function_address(name) for name in names)


def _engine(key: str, write: Callable[[], ir.Module]) -> Any:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    cpu, features = _processor()
    machine = llvm.Target.from_default_triple().create_target_machine(
        cpu=cpu, features=features, opt=_OPTIMISATION, jit=True
    )
    code = _read(key)
    if code is None:
        code = _compiled(write(), machine)
        _keep(key, code)
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    return engine


def _compiled(module: ir.Module, machine: Any) -> bytes:
    module.triple = machine.triple
    parsed = llvm.parse_assembly(str(module))
    parsed.verify()
    options = llvm.create_pipeline_tuning_options(_OPTIMISATION)
    passes = llvm.create_pass_builder(machine, options)
    passes.getModulePassManager().run(parsed, passes)
    code: bytes = machine.emit_object(parsed)
    return code


def _key(described: bytes, write: Callable[[], ir.Module]) -> str:
    digest = hashlib.sha256(described)
    made_of = _made_of(write.__module__)
    for part in (made_of, *_processor(), str(llvm.llvm_version_info)):
        digest.update(b"\0" + part.encode())
    return digest.hexdigest()


@lru_cache
def _made_of(module: str) -> str:
    """Fingerprint of a module that writes, and of this one that compiles."""
    return fingerprint(sys.modules[module], sys.modules[__name__])


def _file(key: str) -> Path:
    return cache_directory() / f"straight_line.{key[:32]}.o"


def _read(key: str) -> bytes | None:
    """Code that was kept, if it is whole: LLVM would crash on half of it."""
    try:
        kept = _file(key).read_bytes()
    except (OSError, RuntimeError):
        return None
    digest, code = kept[:_DIGEST], kept[_DIGEST:]
    return code if hashlib.sha256(code).digest() == digest else None


def _keep(key: str, code: bytes) -> None:
    """Write code and its digest to a file; without a place to write, do without."""
    try:
        directory = cache_directory()
        directory.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=directory)
    except (OSError, RuntimeError):
        return
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(hashlib.sha256(code).digest() + code)
        Path(name).replace(_file(key))
    except OSError:  # no space left; on Windows, somebody is reading the file
        Path(name).unlink(missing_ok=True)

"""From an LLVM module to functions that can be called, kept on disk for the next time."""

from __future__ import annotations

import hashlib
import threading
from collections.abc import Callable, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
from llvmlite import ir
from numba import config

from heelstrike.compiler import kept_code
from heelstrike.compiler.fingerprint import fingerprint
from heelstrike.compiler.kept_code import directories

_OPTIMISATION = 1  # more costs time and gains nothing on straight-line code

_loaded: dict[bytes, Any] = {}
"""Engines by key. They hold the code, and live as long as the process."""

_loading = threading.Lock()
"""Held while an engine is made: a second one of the same key would take the first one's place."""


def can_fuse() -> bool:
    """Whether this processor multiplies and adds in one instruction."""
    return llvm.get_process_triple().startswith(("aarch64", "arm64")) or "+fma" in (
        processor()[1].split(",")
    )


@lru_cache(maxsize=1)
def processor() -> tuple[str, str]:
    """Name and features of the processor to compile for, as Numba has them."""
    settings: Any = config
    name = settings.CPU_NAME or llvm.get_host_cpu_name()
    features = settings.CPU_FEATURES
    if features is None:
        features = "" if settings.CPU_NAME else llvm.get_host_cpu_features().flatten()
    return name, features


def addresses(
    names: Sequence[str], described: bytes, made_of: str, write: Callable[[], ir.Module]
) -> tuple[int, ...]:
    """Return the addresses of the functions of a module, which is compiled if it is new.

    Parameters
    ----------
    names : sequence of str
        Names of the functions.
    described : bytes
        What the module depends on besides what its writer is made of, and the processor.
    made_of : str
        Fingerprint of what writes the module.
    write : callable
        Writes the module.
    """
    key = _key(described, made_of)
    with _loading:
        if key not in _loaded:
            _loaded[key] = _engine(_name(described), key, write)
        return tuple(_loaded[key].get_function_address(name) for name in names)


def _engine(name: str, key: bytes, write: Callable[[], ir.Module]) -> Any:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    cpu, features = processor()
    machine = llvm.Target.from_default_triple().create_target_machine(
        cpu=cpu, features=features, opt=_OPTIMISATION, jit=True
    )
    places = directories(Path(__file__))
    code = kept_code.read(places, name, key)
    if code is None:
        code = _compiled(write(), machine)
        kept_code.write(places, name, key, code)
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    return engine


def _compiled(module: ir.Module, machine: Any) -> bytes:
    module.triple = machine.triple
    parsed = llvm.parse_assembly(str(module))
    parsed.verify()
    options = llvm.create_pipeline_tuning_options(_OPTIMISATION)
    options.slp_vectorization = False
    passes = llvm.create_pass_builder(machine, options)
    passes.getModulePassManager().run(parsed, passes)
    code: bytes = machine.emit_object(parsed)
    return code


def _name(described: bytes) -> str:
    """Name of the file, which the next version of the sources takes over."""
    digest = hashlib.sha256(described + repr(processor()).encode())
    return f"straight_line.{digest.hexdigest()[:32]}.machine_code"


def _key(described: bytes, made_of: str) -> bytes:
    """What the code is for."""
    digest = hashlib.sha256(described)
    version = str(llvm.llvm_version_info)
    for part in (made_of, fingerprint(_compiled, _OPTIMISATION), *processor(), version):
        digest.update(b"\0" + part.encode())
    return digest.digest()

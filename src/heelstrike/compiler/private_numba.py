"""What Numba does not document, and what makes it compile in half its time.

All of it is here, but for the members of bundles, which are in
:mod:`heelstrike.compiler.private_members`.

Numba optimises every function, turns it into machine code, and does so again in every function that
calls it. For kernels nested six deep that is a third of the time to compile. Here a kernel that
only other kernels call stays an unfinished module until an outer kernel has taken in everything it
needs and is optimised as a whole, once. Another fifth goes into asking what ``a + b`` may mean.
Loops that differ in constants alone are the same unfinished module, and optimised one by one.

The next Numba may know these names no more, or mean something else by them;
:meth:`PrivateNumba.test` finds out.
"""

from __future__ import annotations

import hashlib
import importlib
import pickle
import re
import sys
import zlib
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from pathlib import Path
from typing import Any

import numpy as np
from llvmlite.binding import parse_assembly, parse_bitcode
from numba import TypingError, config, njit, types
from numba.core.caching import NullCache
from numba.core.cgutils import normalize_ir_text
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, CompileResult, DefaultPassBuilder
from numba.core.compiler_lock import global_compiler_lock
from numba.core.compiler_machinery import register_pass
from numba.core.runtime.nrt import rtsys
from numba.core.serialize import dumps
from numba.core.sigutils import normalize_signature
from numba.core.typed_passes import InlineOverloads, NativeLowering, NopythonRewrites
from numba.core.types.functions import BaseFunction
from numba.core.untyped_passes import InlineClosureLikes
from numba.np import linalg

from heelstrike.compiler import kept_code
from heelstrike.compiler.bundle_type import Fixed, definitions
from heelstrike.compiler.documented_numba import (
    OPTIONS,
    DocumentedNumba,
    Result,
    no_garbage_collection,
)
from heelstrike.compiler.fingerprint import fingerprint, is_ours
from heelstrike.compiler.machine_code import processor
from heelstrike.interruption import kept_interrupts


class PrivateNumba(DocumentedNumba):
    """The same, in half the time."""

    shaping = (*DocumentedNumba.shaping, "heelstrike.compiler.private_members", __name__)
    level = 3

    def part(self, function: Callable[..., Any], *, dissolved: bool, rare: bool) -> Any:
        """Return a kernel without machine code of its own; it counts no references."""
        passes = _RareKernelCompiler if rare else _InnerKernelCompiler
        return _unfinished(
            function, passes, no_cpython_wrapper=True, forceinline=dissolved, _nrt=False
        )

    def kept(
        self, function: Callable[..., Any], *, boundscheck: bool = False, separate: bool = False
    ) -> Any:
        """Return a function that is compiled when it is called, and kept on disk."""
        options = OPTIONS | {"no_cfunc_wrapper": not separate}
        compiled: Any = njit(**options, boundscheck=boundscheck or None)(function)
        compiled._cache = _Cache(compiled, self.made_of(function), self.settings())
        return compiled

    def compile(self, call: Callable[[], Result]) -> Result:
        """Make a call that compiles something."""
        with ExitStack() as stack:
            # LLVM hands machine code over in a callback, which swallows what Ctrl-C raises.
            stack.enter_context(kept_interrupts())
            stack.enter_context(global_compiler_lock)  # one at a time, as Numba compiles anyway
            stack.enter_context(_remembered_typings())
            stack.enter_context(no_garbage_collection())
            return call()

    def loop(
        self, signature: Any, function: Callable[..., Any], fixed: Fixed, *, addressed: bool
    ) -> tuple[Callable[..., Any], Callable[[], int]]:
        """Return what may be called with arguments of exactly the right types.

        Numba compares the types of all arguments with those it compiled for, at every call. What is
        `addressed` can be called by the C calling convention, too; returned is what finds it.
        """
        compiled = _unfinished(function, no_cpython_wrapper=False, no_cfunc_wrapper=not addressed)
        cache = _Cache(compiled, self.made_of(function), self.settings())
        result = self.compile(lambda: _loop(compiled, cache, signature, fixed))
        name = result.fndesc.llvm_cfunc_wrapper_name
        return result.entry_point, lambda: int(result.library.get_pointer_to_function(name))

    def separate(
        self, signature: Any, function: Callable[..., Any], *, boundscheck: bool = False
    ) -> tuple[Any, int]:
        """Compile a function for the C calling convention; return it and its address."""
        compiled = self.kept(function, boundscheck=boundscheck, separate=True)
        self.compile(lambda: _separate(compiled, signature))
        compiled.disable_compile()
        result = compiled.get_compile_result(signature)
        return compiled, result.library.get_pointer_to_function(
            result.fndesc.llvm_cfunc_wrapper_name
        )

    def is_kept(self, signature: Any, function: Callable[..., Any]) -> bool:
        """Whether :meth:`separate` would find machine code, or has no disk to look on."""
        cache: _Cache = self.kept(function, separate=True)._cache
        return cache.read(signature) is not None or kept_code.first_writable(cache.places) is None

    def test(self) -> None:
        """Compile a small kernel, keep and load it, and compare with Python; raise if it differs.

        What has passed is kept on disk, until Numba or this module changes.
        """
        places = kept_code.directories(Path(__file__))
        name, key = "private_numba.tested", bytes.fromhex(self.made_of(_inner))
        if kept_code.read(places, name, key) is not None:
            return
        parts = [self.part(_inner, dissolved=False, rare=rare) for rare in (False, True)]
        outer = _outer(*parts)
        compiled = self.kept(outer)
        compiled._cache.places = []
        signature = types.float64(types.float64[::1], types.int64)
        self.compile(lambda: compiled.compile(signature))
        loaded = compiled._cache.rebuilt(
            compiled.targetctx, dumps(_parts(compiled.get_compile_result(signature)))
        )
        raw = _unfinished(outer, no_cpython_wrapper=False)
        loop = self.compile(lambda: _loop(raw, compiled._cache, signature, ()).entry_point)
        expected = np.ones(3)
        wanted = _outer(_inner, _inner)(expected, 3)
        for call in (compiled, loaded.entry_point, loop):
            found = np.ones(3)
            if call(found, 3) != wanted or found.tobytes() != expected.tobytes():
                raise ArithmeticError("a small kernel does not compute what Python computes")
        kept_code.write(places, name, key, b"passed")


def _inner(values: Any, place: int) -> float:
    values[place] = 2.0 * values[place - 1] + 0.1
    return values[place] / 3.0


def _outer(inner: Callable[..., float], rare: Callable[..., float]) -> Callable[..., float]:
    def outer(values: Any, count: int) -> float:
        total = 0.0
        for place in range(1, count):
            total += inner(values, place) - rare(values, place)
        return total

    return outer


class _UnfinishedLibrary(JITCodeLibrary):
    """A module with what it calls linked in, and nothing else done to it."""

    def add_ir_module(self, ir_module: Any) -> None:
        # Not verified, as the outer kernel is.
        module = parse_assembly(normalize_ir_text(str(ir_module)))
        module.name = ir_module.name
        self.add_llvm_module(module)

    def finalize(self) -> None:
        for library in dict.fromkeys(self._linking_libraries):
            if hasattr(self, "_reload_init"):  # since 0.63
                self._reload_init.update(library._reload_init)
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._finalized = True

    def serialize_using_object_code(self) -> tuple[str, str, bytes]:
        """What is kept of it: object code there is none."""
        self._ensure_finalized()
        bitcode: bytes = self._final_module.as_bitcode()
        return self.name, "unfinished", zlib.compress(bitcode, 1)


@register_pass(mutates_CFG=True, analysis_only=False)
class _UnfinishedLowering(NativeLowering):
    """Turn a kernel into an unfinished module."""

    _name = "unfinished_lowering"

    def run_pass(self, state: Any) -> bool:
        _check_result(state.func_id.func_name, state.return_type)
        state.library = _UnfinishedLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        state.flags.no_compile = True
        super().run_pass(state)
        # Numba asks for the Python function of a kernel. This one is like no other, and raises.
        entry: Any = [].index
        state.targetctx.insert_user_function(entry, state["cr"].fndesc, [state.library])
        state["cr"] = state["cr"]._replace(cfunc=entry)
        return True


@register_pass(mutates_CFG=True, analysis_only=False)
class _RareLowering(_UnfinishedLowering):
    """Turn a kernel into an unfinished module that others call, but do not take in."""

    _name = "rare_lowering"

    def run_pass(self, state: Any) -> bool:
        super().run_pass(state)
        module, name = state.library._final_module, state["cr"].fndesc.mangled_name
        for attribute in ("noinline", "cold"):
            module.get_function(name).add_function_attribute(attribute)
        return True


def _check_result(name: str, kind: Any) -> None:
    """Refuse a kernel that returns an array: nobody would count the caller's new reference."""
    parts = getattr(kind, "types", (kind,))
    if any(isinstance(part, types.Array) for part in parts):
        raise TypingError(
            f"{name}: a kernel returns numbers; let it write into an array it is given"
        )


# Passes that look for array expressions, closures and functions to inline: kernels have none.
_NEEDLESS = (NopythonRewrites, InlineOverloads, InlineClosureLikes)


class _InnerKernelCompiler(CompilerBase):
    """Numba's compiler without what kernels do not need, ending in `_UnfinishedLowering`."""

    lowering: type[NativeLowering] = _UnfinishedLowering

    def define_pipelines(self) -> list[Any]:
        """Leave steps out, and replace the one that makes machine code."""
        pipeline = DefaultPassBuilder.define_nopython_pipeline(self.state)
        pipeline.passes = [
            (self.lowering, "unfinished lowering") if step is NativeLowering else (step, text)
            for step, text in pipeline.passes
            if step not in _NEEDLESS
        ]
        pipeline.finalize()
        return [pipeline]


class _RareKernelCompiler(_InnerKernelCompiler):
    """The same for kernels that others do not take in."""

    lowering = _RareLowering


def _unfinished(
    function: Callable[..., Any], passes: type[CompilerBase] = _InnerKernelCompiler, **more: bool
) -> Any:
    """Return a function that Numba compiles up to an unfinished module."""
    options = OPTIONS | {"no_cfunc_wrapper": True} | more
    return njit(**options, pipeline_class=passes)(function)


def _loop(compiled: Any, cache: _Cache, signature: Any, fixed: Fixed) -> Any:
    """Load a loop, or finish what there is of it with its constants; return its result."""
    asked, context = (signature, fixed), compiled.targetctx
    code = cache.read(asked)
    if code is None:
        with cache.alone(signature):
            code = cache.read(asked)
            if code is None:
                raw = cache.read(signature)
                if raw is None:
                    compiled.compile(signature)
                    raw = dumps(compiled.get_compile_result(signature)._reduce())
                    cache.write(signature, raw)
                code = dumps(_finished(context.codegen(), pickle.loads(raw), fixed))
                cache.write(asked, code)
    return cache.rebuilt(context, code)


def _separate(compiled: Any, signature: Any) -> None:
    """Load a separate kernel, or compile it."""
    kept = compiled._cache.read(signature) is not None
    with nullcontext() if kept else compiled._cache.alone(signature):
        compiled.compile(signature)


def _finished(codegen: Any, parts: tuple[Any, ...], fixed: Fixed) -> tuple[Any, ...]:
    """Put constants into an unfinished module and optimise it; return the parts of its result.

    All its functions are its own but those that Python and others call, whose names are those of no
    other: those of loops with other constants compute something else.
    """
    (name, _, bitcode), about, *more = parts
    module = parse_bitcode(zlib.decompress(bitcode))
    constants = parse_assembly(definitions(fixed))
    constants.triple, constants.data_layout = module.triple, module.data_layout
    module.link_in(constants)
    doors = (about.llvm_cpython_wrapper_name, about.llvm_cfunc_wrapper_name)
    names = []
    own = hashlib.sha256(repr(fixed).encode()).hexdigest()[:12]
    for function in module.functions:
        if function.name in doors and not function.is_declaration:
            function.name = f"{function.name}_{own}"
            names.append(function.name)
        elif not function.is_declaration:
            # Not "internal": the linker of object code in memory knows those by their names, and
            # would take a function that was specialised here for the one that others call.
            function.linkage = "private"
    about.mangled_name = f"{about.mangled_name}_{own}"
    library = codegen.create_library(f"{name}_{own}")
    library._final_module = module
    # Numbers that stand side by side are computed together. Numba leaves that out by default, since
    # LLVM had made wrong code of some loops (numba issue 8705); what these compute is tested.
    with _replaced(config, "SLP_VECTORIZE", 1):
        library._optimize_final_module()
    library._final_module.verify()
    code = codegen._tm.emit_object(library._final_module), _names_alone(names)
    return (library.name, "object", code), about, *more


def _parts(result: Any) -> tuple[Any, ...]:
    """Return what a result is made of, without the bitcode for others to take in: nobody does."""
    (name, kind, (code, _)), *more = result._reduce()
    names = [each.name for each in result.library.get_defined_functions()]
    return (name, kind, (code, _names_alone(names))), *more


def _names_alone(names: list[str]) -> bytes:
    """Return bitcode from which Numba knows which functions there are."""
    empty = "\n".join(f'define void @"{name}"() {{ ret void }}' for name in names)
    bitcode: bytes = parse_assembly(empty).as_bitcode()
    return bitcode


class _Cache(NullCache):
    """Machine code on disk that is good for exactly what the kernel is made of.

    Numba's own cache looks at the file of a kernel only: it would go on using yesterday's machine
    code of a kernel whose callee in another file has changed, compile again for the sake of a
    comment, and take damaged files for good.
    """

    def __init__(self, compiled: Any, made_of: str, settings: list[str]) -> None:
        function = compiled.py_func
        source = Path(function.__code__.co_filename)
        # To load machine code Numba imports the module by its name.
        has_module = function.__module__ in sys.modules
        found = kept_code.directories(source if source.is_file() else None)
        self.places = found if has_module else []
        self._is_ours = is_ours(function)
        self._made_of = made_of
        twin = "" if self._is_ours else _twin_of(function)
        options = sorted(compiled.targetoptions.items())
        self._kind = repr((options, settings, processor(), twin))
        self._name = re.sub("[<>]", "", f"{function.__module__}.{function.__qualname__}")

    @property
    def cache_path(self) -> str:
        """Where machine code is kept if that can be written."""
        return str(self.places[0]) if self.places else ""

    def load_overload(self, signature: Any, context: Any) -> Any:
        """Load machine code, if there is some.

        Numba first loads all that it could compile with, which takes as long as to import it. What
        kernels of this package need to run is the bare runtime.
        """
        found = self.read(signature)
        result = None if found is None else self.rebuilt(context, found)
        if result is None:
            _load_numba()
            return None
        # Of types that only look alike Numba would not find it, and would load it at every call.
        asked, _ = normalize_signature(signature)
        return result if result.signature.args == asked else None

    def rebuilt(self, context: Any, code: bytes) -> Any:
        """Return what can be called, made of what is kept; None if that calls what is not here."""
        _load_numba()
        if self._is_ours:
            rtsys.initialize(context)
        else:
            context.refresh()
        try:
            parts = pickle.loads(code)
        except (AttributeError, ImportError):  # it calls kernels of modules that are not here now
            return None
        return CompileResult._rebuild(context, *parts)

    def read(self, asked: Any) -> bytes | None:
        """Return what is kept for a signature, or for one with constants."""
        return kept_code.read(self.places, *self._name_and_key(asked))

    def write(self, asked: Any, code: bytes) -> None:
        """Keep it for a signature, or for one with constants."""
        kept_code.write(self.places, *self._name_and_key(asked), code)

    def alone(self, asked: Any) -> AbstractContextManager[None]:
        """Make what is kept for a signature while no other process does."""
        name, _ = self._name_and_key(asked)
        return kept_code.alone(self.places, name)

    def save_overload(self, signature: Any, result: Any) -> None:
        """Keep machine code, unless it is good for this process only."""
        if result.library.has_dynamic_globals or any(not loop.can_cache for loop in result.lifted):
            return
        self.write(signature, dumps(_parts(result)))

    def _name_and_key(self, asked: Any) -> tuple[str, bytes]:
        """Name of the file, which the next version of the kernel takes over, and what it is for."""
        kind = f"{asked!r} {self._kind}"
        place = hashlib.sha256(kind.encode()).hexdigest()[:16]
        name = f"{self._name}.{place}.{sys.implementation.cache_tag}.machine_code"
        return name, hashlib.sha256(f"{self._made_of} {kind}".encode()).digest()


def _twin_of(function: Any) -> str:
    """Tell functions of one name apart: where they stand, and what they enclose."""
    cells = [cell.cell_contents for cell in function.__closure__ or ()]
    return fingerprint(function.__code__.co_firstlineno, *cells)


def _load_numba() -> None:
    """Load what Numba compiles with, but not SciPy's linear algebra.

    Numba would load that, which takes as long as all the rest, only to see whether it is there.
    This package requires SciPy. A kernel that needs it still loads it.
    """
    with _replaced(linalg, "ensure_blas", lambda: None):
        importlib.import_module("numba.np.arraymath")


@contextmanager
def _replaced(owner: Any, name: str, value: Any) -> Iterator[None]:
    usual = getattr(owner, name)
    setattr(owner, name, value)
    try:
        yield
    finally:
        setattr(owner, name, usual)


@contextmanager
def _remembered_typings() -> Iterator[None]:
    """Remember what built-in functions return for plain arguments.

    For every ``a + b`` in a kernel Numba asks each of the many things that ``+`` can mean in turn,
    and compares all its compiler settings to do so. Within one compilation the answer for numbers
    and arrays of numbers is always the same; here it is asked for once.
    """
    ask = BaseFunction.get_call_type
    answers: dict[Any, Any] = {}

    def get_call_type(self: Any, context: Any, args: Any, kws: Any) -> Any:
        if kws or not all(_is_plain(argument) for argument in args):
            return ask(self, context, args, kws)
        key = (self, context, tuple(args))
        if key not in answers:
            answers[key] = ask(self, context, args, kws)
        return answers[key]

    with _replaced(BaseFunction, "get_call_type", get_call_type):
        yield


_PLAIN = (types.Number, types.Boolean, types.Array, types.SliceType, types.NoneType)


def _is_plain(kind: Any) -> bool:
    members = kind.types if isinstance(kind, types.Tuple | types.UniTuple) else (kind,)
    return all(isinstance(member, _PLAIN) for member in members)

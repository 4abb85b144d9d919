"""Kernels without machine code of their own, which the kernels that call them take in.

Numba optimises every function, turns it into machine code, and does so again in every function that
calls it. For kernels nested six deep that is most of the time to compile. Here a kernel that only
other kernels call stays an unfinished module until an outer kernel has taken in everything it needs
and is optimised as a whole, once.
"""

from __future__ import annotations

from typing import Any

from llvmlite.binding import parse_assembly
from numba import types
from numba.core.cgutils import normalize_ir_text
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import register_pass
from numba.core.errors import TypingError
from numba.core.typed_passes import InlineOverloads, NativeLowering, NopythonRewrites
from numba.core.untyped_passes import InlineClosureLikes


class _UnfinishedLibrary(JITCodeLibrary):
    """A module with what it calls linked in, and nothing else done to it."""

    def add_ir_module(self, ir_module: Any) -> None:
        # Not verified, as the outer kernel is.
        module = parse_assembly(normalize_ir_text(str(ir_module)))
        module.name = ir_module.name
        self.add_llvm_module(module)

    def finalize(self) -> None:
        for library in dict.fromkeys(self._linking_libraries):
            self._reload_init.update(library._reload_init)
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._finalized = True


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


def _check_result(name: str, kind: Any) -> None:
    """Refuse a kernel that returns an array: nobody would count the caller's new reference."""
    parts = getattr(kind, "types", (kind,))
    if any(isinstance(part, types.Array) for part in parts):
        raise TypingError(
            f"{name}: a kernel returns numbers; let it write into an array it is given"
        )


# Passes that look for array expressions, closures and functions to inline: kernels have none.
_NEEDLESS = (NopythonRewrites, InlineOverloads, InlineClosureLikes)


class InnerKernelCompiler(CompilerBase):
    """Numba's compiler without what kernels do not need, ending in `_UnfinishedLowering`."""

    def define_pipelines(self) -> list[Any]:
        """Leave steps out, and replace the one that makes machine code."""
        pipeline = DefaultPassBuilder.define_nopython_pipeline(self.state)
        pipeline.passes = [
            (_UnfinishedLowering, "unfinished lowering") if step is NativeLowering else (step, text)
            for step, text in pipeline.passes
            if step not in _NEEDLESS
        ]
        pipeline.finalize()
        return [pipeline]

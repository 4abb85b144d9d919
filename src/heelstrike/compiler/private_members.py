"""How compiled code finds the members of bundles, by names that Numba does not document.

:meth:`~heelstrike.compiler.documented_numba.DocumentedNumba.declare` does without, if the next
Numba knows them no more: then every member that is read is a function to compile.
"""

from __future__ import annotations

from functools import cache
from typing import Any

from numba import typeof, types
from numba.core.typing.templates import AbstractTemplate, AttributeTemplate
from numba.extending import infer_getattr, lower_builtin, lower_getattr_generic

from heelstrike.compiler.bundle_type import BundleType


@infer_getattr
class _Members(AttributeTemplate):
    key = BundleType

    def generic_resolve(self, kind: BundleType, name: str) -> Any:  # type: ignore[override]
        return kind.member(name) or _method(kind, name)


@lower_getattr_generic(BundleType)
def _read(context: Any, builder: Any, kind: BundleType, table: Any, name: str) -> Any:
    return kind.read(context, builder, table, name)


@cache
def _method(kind: BundleType, name: str) -> Any:
    """Type of a kernel of the class of a bundle, bound to the bundle."""
    if kind.method(name) is None:
        return None
    function: Any = typeof(kind.method(name))

    class Method(AbstractTemplate):
        key = f"{kind.name}.{name}"

        def generic(self, arguments: Any, keywords: Any) -> Any:
            return function.get_call_type(self.context, (kind, *arguments), keywords).as_method()

    @lower_builtin(Method.key, kind, types.VarArg(types.Any))
    def call(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return context.get_function(function, signature)(builder, values)

    return types.BoundFunction(Method, kind)

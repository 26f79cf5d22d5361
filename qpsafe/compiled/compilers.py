"""How compiled code is compiled here: by numba's own compiler, less what is done twice.

1. numba optimises every function, with all it calls, and makes machine code of it before its caller may call it; the
   caller then optimises all of it once more. For an inner function, which is never called from Python, the first is for
   nothing: it is typed and translated to LLVM's language, and goes into its caller like that.
2. For every single `a[i]` numba goes through all types that have such an operator, twice, which takes a third of the
   time. The answer depends on the types only, so it is kept.
3. To numba `f(a, 0)` and `f(a, 1)` are two functions to compile; here they are one.
4. Passes for what this code has none of, closures and array expressions, are left out.
"""

from __future__ import annotations

from typing import Any

from numba import types
from numba.core import typed_passes, untyped_passes
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.compiler_machinery import register_pass
from numba.core.typing import Context


class _Operator(types.Function):
    """An operator that remembers what it returns for which types."""

    def __init__(self, function: types.Function) -> None:
        self.__dict__.update(function.__dict__)
        self.known: dict[Any, Any] = {}

    def get_call_type(self, context: Any, args: Any, kws: Any) -> Any:
        if kws:
            return super().get_call_type(context, args, kws)
        if args not in self.known:
            self.known[args] = super().get_call_type(context, args, kws)
        return self.known[args]


_operators: dict[types.Function, _Operator] = {}


class _Remembering(Context):
    """numba's typing context with operators that remember."""

    def __init__(self, context: Context) -> None:
        self.__dict__ = context.__dict__

    def resolve_value_type(self, value: Any) -> Any:
        found = super().resolve_value_type(value)
        if not isinstance(found, types.Function) or getattr(value, "__module__", "") not in ("_operator", "builtins"):
            return found
        if found not in _operators:
            _operators[found] = _Operator(found)
        return _operators[found]

    def resolve_function_type(self, function: Any, args: Any, kws: Any) -> Any:
        if isinstance(function, types.Dispatcher):  # f(a, 0) and f(a, 1) are the same function
            args = tuple(types.unliteral(kind) for kind in args)
        if getattr(function, "__module__", "") in ("_operator", "builtins"):
            function = self.resolve_value_type(function)
        return super().resolve_function_type(function, args, kws)


class _InnerLibrary(JITCodeLibrary):
    """LLVM code for callers to link; it never becomes machine code."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        self._ensure_finalized()
        return 0

    @property
    def codegen(self) -> Any:
        return self

    def set_env(self, name: str, environment: Any) -> None:
        """The address of an environment belongs to machine code; and only object mode asks for it."""


@register_pass(mutates_CFG=True, analysis_only=False)
class _InnerLowering(typed_passes.NativeLowering):
    _name = "inner_lowering"

    def run_pass(self, state: Any) -> bool:
        state.library = _InnerLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        return bool(super().run_pass(state))


class EntryCompiler(Compiler):
    """numba's compiler, with 2. to 4.

    Args:
        typing_context: numba's.
        target_context: numba's.
        others: What else numba gives.
    """

    def __init__(self, typing_context: Any, target_context: Any, *others: Any) -> None:
        super().__init__(typing_context, target_context, *others)
        self.state.typingctx = _Remembering(typing_context)
        self.state.targetctx = self.state.targetctx.subtarget(typing_context=self.state.typingctx)

    def define_pipelines(self) -> Any:
        """The steps of compiling a function."""
        pipelines = super().define_pipelines()
        for pipeline in pipelines:
            pipeline.passes = [(self.step(step), text) for step, text in pipeline.passes if self.step(step)]
            pipeline.finalize()
        return pipelines

    @staticmethod
    def step(step: Any) -> Any:
        """What stands in for a step of the pipeline."""
        return None if step in (untyped_passes.InlineClosureLikes, typed_passes.NopythonRewrites) else step


class InnerCompiler(EntryCompiler):
    """numba's compiler, with all of that"""

    @staticmethod
    def step(step: Any) -> Any:
        """What stands in for a step of the pipeline."""
        return _InnerLowering if step is typed_passes.NativeLowering else EntryCompiler.step(step)

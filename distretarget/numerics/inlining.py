"""How numba compiles functions that become parts of others: without machine code of their own.

numba optimises every function that it compiles and makes machine code of it. A function that becomes a part of its
callers is optimised there once more, and its own machine code is never run. Leaving out both saves a fifth of the first
run's time.
"""

from __future__ import annotations

from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import PassManager, register_pass
from numba.core.typed_passes import NativeLowering


class InlinedCompiler(CompilerBase):
    """Compiles functions that become parts of others."""

    def define_pipelines(self) -> list[PassManager]:
        """The passes that a function goes through: those of numba, but for the one that makes code."""
        passes = PassManager("inlined")
        for step, description in DefaultPassBuilder.define_nopython_pipeline(self.state).passes:
            passes.add_pass(_Lowering if step is NativeLowering else step, description)
        passes.finalize()
        return [passes]


@register_pass(mutates_CFG=True, analysis_only=False)
class _Lowering(NativeLowering):
    """Makes LLVM code, and stops there."""

    _name = "inlined_lowering"

    def run_pass(self, state: Any) -> bool:
        state.library = _Library(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        state.flags.no_compile = True
        super().run_pass(state)
        entry = list[None]().append  # numba finds a function by its entry point; any other builtin serves as well
        state.targetctx.insert_user_function(entry, state["cr"].fndesc, [state.library])
        state["cr"] = state["cr"]._replace(cfunc=entry)
        return True


class _Library(JITCodeLibrary):
    """LLVM code to link with that of a caller, which optimises it."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalized = True

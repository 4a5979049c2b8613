"""The steps by which numba compiles a kernel: those that the language of kernels needs.

numba's own list has further steps for closures, contexts, parallel loops, array expressions and
Python objects, and for annotated listings. Kernels have none of these, and without the steps they
compile in about half the time, to the same instructions.
"""

from __future__ import annotations

from functools import cache
from typing import Any


@cache
def kernel_pipeline() -> Any:
    """A kind of compiler for ``numba.njit(pipeline_class=...)``."""
    from numba.core import typed_passes, untyped_passes
    from numba.core.compiler import CompilerBase
    from numba.core.compiler_machinery import PassManager

    steps = (
        (untyped_passes.TranslateByteCode, "read the byte code"),
        (untyped_passes.FixupArgs, "name the arguments"),
        (untyped_passes.IRProcessing, "order the statements"),
        (untyped_passes.GenericRewrites, "constant places in tuples"),
        (untyped_passes.ReconstructSSA, "one assignment for each name"),
        (typed_passes.NopythonTypeInference, "find the types"),
        (typed_passes.PreLowerStripPhis, "remove the joins of names"),
        (typed_passes.IRLegalization, "check what is left"),
        (typed_passes.NativeLowering, "write LLVM's language"),
        (typed_passes.NoPythonBackend, "finish"),
    )

    class KernelCompiler(CompilerBase):  # type: ignore[misc]  # numba is not typed
        """numba's compiler with these steps."""

        def define_pipelines(self) -> list[Any]:
            manager = PassManager("kernel")
            for step, text in steps:
                manager.add_pass(step, text)
            manager.finalize()
            return [manager]

    return KernelCompiler

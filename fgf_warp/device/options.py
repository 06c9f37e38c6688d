"""How kernels are compiled."""

import platform
from typing import Any

CPU_FLAGS = "-march=native -freciprocal-math"
"""Quotients by the reciprocal: two units in the last place, and a tenth faster over all."""
if platform.machine().lower() in ("x86_64", "amd64"):
    # Sixteen lanes at a time where the processor has AVX-512, for the compiler would take eight; and two such rows at a
    # time, since a loop over lanes is one long chain of operations that wait for each other.
    CPU_FLAGS += " -mprefer-vector-width=512 -mllvm -force-vector-interleave=2"


def kernel_options(meshes: bool) -> dict[str, Any]:
    """Options of a kernel that meets triangles, or of one that does not.

    Products are only fused into sums where there are none: the edge functions of two triangles must be equal and
    opposite, or rays pass between them.
    """
    flags = CPU_FLAGS if meshes else f"-ffp-contract=fast {CPU_FLAGS}"
    return {"enable_backward": False, "fuse_fp": not meshes, "cpu_compiler_flags": flags}

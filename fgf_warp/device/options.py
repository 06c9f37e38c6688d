"""How kernels are compiled: for speed as far as it costs no accuracy, so that nobody has to choose.

In units of the processor time with these flags, medians of renders by turns: on sphere, which has no triangles, 1.12
without the reciprocals, 1.10 without fused products, and 0.98 with all of ``-ffast-math``; on cloud_block, which has
some, 1.01 with the latter. Two equal builds differ by 0.01. The pictures of equal seeds differ by 3e-9, 8e-6 and 9e-7
of the mean radiance on sphere, whose noise at 1024 samples is 7e-3, and on cloud_block, where some paths part, by a
fifth of the noise. With ``-ffast-math`` no kernel could test for what is not finite, and it brings too little to be a
setting.
"""

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

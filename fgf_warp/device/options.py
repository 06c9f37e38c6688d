"""How kernels are compiled."""

import platform

CPU_FLAGS = "-march=native -freciprocal-math"
"""Quotients by the reciprocal: two units in the last place, and a tenth faster over all."""
if platform.machine().lower() in ("x86_64", "amd64"):
    # Sixteen lanes at a time where the processor has AVX-512; the compiler would take eight.
    CPU_FLAGS += " -mprefer-vector-width=512"

KERNEL_OPTIONS = {"enable_backward": False, "fuse_fp": False, "cpu_compiler_flags": CPU_FLAGS}
"""Without contraction on CUDA: edge functions of two triangles must be equal and opposite to stay watertight."""

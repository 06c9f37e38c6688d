"""The life of a path, from the camera to its end, built for exactly the features that a scene has.

Path tracing with multiple scattering, next-event estimation, and multiple importance sampling (Veach 1997, power
heuristic) between lights and phase function or BSDF. Free flights are sampled in proportion to their density, so
they carry no weight; in a medium whose channels differ, one channel is drawn per path and the balance heuristic
over channels weighs it.

A path lives in stages, see `stages.py`, each from a `Path` to a `Path`. Two drivers take paths through them: on CUDA a
thread takes one path through all of them (`threads.py`); on the CPU a pool of lanes takes `LANES` paths through one
stage after the other (`pool.py`), so that the compiler makes vector code of what has neither branches nor look-ups.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

from fgf_warp.features import RenderFeatures
from fgf_warp.integrator.planes import Plane
from fgf_warp.integrator.pool import build_render_pool
from fgf_warp.integrator.scene_data import scene_struct
from fgf_warp.integrator.stages import build_stages
from fgf_warp.integrator.threads import build_render_threads


@dataclass(frozen=True)
class Program:
    """The kernels of one set of features.

    Args:
        features: what they were built for.
        render_threads: one thread per pixel, for CUDA.
        render_pool: one pool of lanes per launch, for the CPU.
        scratch_floats: length of the array that a launch of `render_pool` works in.
        scene: the struct that a scene is uploaded into.
        film: the struct with an array for each of `planes`, with an entry per pixel of each image.
        planes: what is summed.
    """

    features: RenderFeatures
    render_threads: Any
    render_pool: Any
    scratch_floats: int
    scene: Any
    film: Any
    planes: tuple[Plane, ...]


@cache
def build_program(features: RenderFeatures) -> Program:
    """The kernels that render scenes of these features; compiled when they are first loaded on a device."""
    stages = build_stages(features)
    return Program(
        features,
        build_render_threads(features, stages),
        build_render_pool(features, stages),
        stages.layout.float_count,
        scene_struct(features),
        stages.tally.film,
        stages.tally.planes,
    )

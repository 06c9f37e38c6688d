"""Renders made without rendering, for tests of what becomes of them."""

import numpy as np

from fgf_warp.result import RenderResult
from fgf_warp.settings import Aov, RenderSettings

VECTOR_AOVS = (
    *(Aov.TRANSMITTANCE, Aov.ALBEDO, Aov.COLLISIONS, Aov.PATH_LENGTH),
    *(Aov.NORMAL, Aov.OPTICAL_DEPTH, Aov.DIRECT, Aov.INDIRECT),
)


def made_up_render(settings: RenderSettings, **provenance) -> RenderResult:
    """A picture that follows from the seed alone, with every plane that the settings ask for."""
    rng = np.random.default_rng(settings.seed)
    shape = (settings.height, settings.width)

    def plane(*channels: int) -> np.ndarray:
        return rng.random((*shape, *channels), dtype=np.float32)

    planes = {Aov.DEPTH: plane() * 10}
    planes |= {aov: plane(3) for aov in VECTOR_AOVS}
    planes |= {Aov.MOTION: plane(2), Aov.SCATTERINGS: plane() * 10}
    planes |= {aov: rng.integers(-1, 9, shape, dtype=np.int32) for aov in (Aov.PRIM_ID, Aov.INSTANCE_ID)}
    planes[Aov.DEPTH][0, 0] = np.inf
    planes[Aov.SAMPLES] = np.full(shape, settings.spp, dtype=np.int32)
    planes[Aov.DENOISED] = planes[Aov.DIRECT] + planes[Aov.INDIRECT]
    return RenderResult(
        radiance=plane(3),
        alpha=plane(),
        variance=plane(3) * 1e-4,
        aovs={aov: values for aov, values in planes.items() if aov in settings.aovs},
        samples=settings.spp,
        path_count=settings.spp * settings.width * settings.height,
        truncated_count=0,
        seconds=0.25,
        settings=settings,
        provenance={"settings": {"seed": settings.seed, "spp": settings.spp}, **provenance},
    )

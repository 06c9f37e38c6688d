"""What a scene makes its kernel pay for: categories only, never numbers, counts or sizes.

The kernel is built for exactly one value of `RenderFeatures`; whatever is False or absent here is not in it.
"""

from __future__ import annotations

from dataclasses import dataclass

from fgf_warp.scene import AreaLight, DistantLight, DomeLight, Mesh, Scene, Solid, SphereLight
from fgf_warp.settings import Aov, RenderSettings, Sampler


@dataclass(frozen=True)
class RenderFeatures:
    """The categories that one kernel is built for.

    Args:
        solids: spheres, cubes or cylinders, as surfaces or boundaries.
        meshes: triangle meshes, as surfaces or boundaries.
        surfaces: anything with a surface.
        shaped_lights: rect, disk or sphere lights, which rays can meet.
        distant_lights: distant lights, with an extent or without.
        environment: a dome. Being uniform it is met by scattered rays and not connected to.
        media: shapes filled with a medium.
        lone_law: the law, ``exponential``, ``power`` or ``fractional``, of the only medium, where one shape is filled
            with a medium and the channels do not differ; otherwise empty, and laws are looked up.
        lone_solid: that one shape is a sphere, cube or cylinder: a ray is in it between two distances, and crosses no
            boundaries one by one.
        chromatic: a medium whose channels differ in extinction.
        aovs: the further planes that need work in the kernel.
        sampler: where random numbers come from.
    """

    solids: bool
    meshes: bool
    surfaces: bool
    shaped_lights: bool
    distant_lights: bool
    environment: bool
    media: bool
    lone_law: str
    lone_solid: bool
    chromatic: bool
    aovs: frozenset[Aov]
    sampler: Sampler

    @property
    def connections(self) -> bool:
        """True where paths connect to lights (next-event estimation)."""
        return self.shaped_lights or self.distant_lights

    @property
    def crossings(self) -> bool:
        """True where paths cross boundaries of media one by one."""
        return self.media and not self.lone_solid


def required_features(scene: Scene, settings: RenderSettings) -> RenderFeatures:
    """The least that renders this scene with these settings."""
    filled = [shape for shape in scene.shapes if shape.medium is not None]
    media = [scene.media[shape.medium] for shape in filled if shape.medium is not None]
    lone_law = media[0].line_law.kind if len(media) == 1 and not media[0].is_chromatic else ""
    return RenderFeatures(
        solids=any(isinstance(shape, Solid) for shape in scene.shapes),
        meshes=any(isinstance(shape, Mesh) for shape in scene.shapes),
        surfaces=any(shape.surface is not None for shape in scene.shapes),
        shaped_lights=any(isinstance(light, AreaLight | SphereLight) for light in scene.lights),
        distant_lights=any(isinstance(light, DistantLight) for light in scene.lights),
        environment=any(isinstance(light, DomeLight) for light in scene.lights),
        media=bool(media),
        lone_law=lone_law,
        lone_solid=lone_law != "" and isinstance(filled[0], Solid),
        chromatic=any(medium.is_chromatic for medium in media),
        aovs=settings.aovs & {Aov.DEPTH, Aov.TRANSMITTANCE, Aov.ALBEDO},
        sampler=settings.sampler,
    )

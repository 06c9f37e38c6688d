"""What a scene makes its kernel pay for: categories only, never numbers, counts or sizes.

The kernel is built for exactly one value of `RenderFeatures`; whatever is False or absent here is not in it.
"""

from __future__ import annotations

from dataclasses import dataclass

from fgf_warp.scene import AreaLight, DistantLight, DomeLight, Mesh, Scene, Solid, SphereLight
from fgf_warp.settings import Aov, RenderSettings


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
        chromatic: a medium whose channels differ in extinction.
        aovs: the further planes that need work in the kernel.
    """

    solids: bool
    meshes: bool
    surfaces: bool
    shaped_lights: bool
    distant_lights: bool
    environment: bool
    media: bool
    lone_law: str
    chromatic: bool
    aovs: frozenset[Aov]

    @property
    def connections(self) -> bool:
        """True where paths connect to lights (next-event estimation)."""
        return self.shaped_lights or self.distant_lights


def required_features(scene: Scene, settings: RenderSettings) -> RenderFeatures:
    """The least that renders this scene with these settings."""
    media = [scene.media[shape.medium] for shape in scene.shapes if shape.medium is not None]
    return RenderFeatures(
        solids=any(isinstance(shape, Solid) for shape in scene.shapes),
        meshes=any(isinstance(shape, Mesh) for shape in scene.shapes),
        surfaces=any(shape.surface is not None for shape in scene.shapes),
        shaped_lights=any(isinstance(light, AreaLight | SphereLight) for light in scene.lights),
        distant_lights=any(isinstance(light, DistantLight) for light in scene.lights),
        environment=any(isinstance(light, DomeLight) for light in scene.lights),
        media=bool(media),
        lone_law=media[0].line_law.kind if len(media) == 1 and not media[0].is_chromatic else "",
        chromatic=any(medium.is_chromatic for medium in media),
        aovs=settings.aovs & {Aov.DEPTH, Aov.TRANSMITTANCE, Aov.ALBEDO},
    )

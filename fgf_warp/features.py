"""What a scene makes its kernel pay for: categories only, never numbers, counts or sizes.

The kernel is built for exactly one value of `RenderFeatures`; whatever is False or absent here is not in it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import UnionType

from fgf_warp.errors import UnsupportedFeatureError
from fgf_warp.scene import (
    PHASE_PARAMETERS,
    AreaLight,
    CylinderLight,
    DistantLight,
    DomeLight,
    Instances,
    Light,
    Medium,
    Mesh,
    MeshLight,
    PhaseFunction,
    Scene,
    Shape,
    Solid,
    SphereLight,
    moves,
    solids_in_tree,
)
from fgf_warp.settings import TRACED_AOVS, Aov, RenderSettings, Sampler

NAMES_SHOWN = 3


@dataclass(frozen=True)
class RenderFeatures:
    """The categories that one kernel is built for.

    Args:
        solids: which of ``sphere``, ``cube`` and ``cylinder`` there are, as surfaces or boundaries that are tried one
            after the other.
        meshes: a tree: of triangles in world space, or over instances.
        instances: what hangs in a tree under transforms: meshes, which share their triangles, or many solids.
        solids_in_tree: so many solids that they hang in that tree.
        motion: shapes or a camera that move while the shutter is open.
        surfaces: anything with a surface.
        shading: surfaces that are more than diffuse, vary, or have normals of their own.
        passes: surfaces that light may pass, straight or refracted.
        lens: a camera that is more than a pinhole.
        varied_starts: camera rays that may begin in different media, so that each finds its own.
        shaped_lights: which of ``rect``, ``disk``, ``sphere``, ``cylinder`` and ``mesh`` lights there are: those that
            rays can meet.
        distant_lights: distant lights, with an extent or without.
        environment: a dome that is the same everywhere and for all, met by scattered rays and not connected to.
        dome_image: a dome with an image, or one that is linked or shaped, which is connected to.
        light_images: rects with an image.
        shaping: lights that emit unevenly.
        links: lights that shine on some shapes, or that some shapes cast shadows of.
        media: shapes filled with a medium.
        contacts: bodies of one medium that may touch, so that it must be told whether they do or overlap.
        lone_law: the law, ``exponential``, ``power``, ``fractional`` or ``exact_fbm``, of the only medium, where one
            shape is filled with a medium and the channels do not differ; otherwise empty, and laws are looked up.
        lone_solid: what that one shape is, ``sphere``, ``cube`` or ``cylinder``: a ray is in it between two distances,
            and crosses no boundaries one by one; otherwise empty.
        chromatic: a medium whose channels differ in extinction.
        phases: which phase functions the media have.
        similarity: media that scatter unevenly, and are replaced by similar ones that do not for long paths.
        frozen: a medium of the mixed transport, where paths may be frozen.
        exact_variance: a fractional Brownian motion with the variance of finite segments; its flights are looked up.
        aovs: the further planes that need work in the kernel.
        sampler: where random numbers come from.
    """

    solids: frozenset[str]
    meshes: bool
    instances: bool
    solids_in_tree: bool
    motion: bool
    surfaces: bool
    shading: bool
    passes: bool
    lens: bool
    varied_starts: bool
    shaped_lights: frozenset[str]
    distant_lights: bool
    environment: bool
    dome_image: bool
    light_images: bool
    shaping: bool
    links: bool
    media: bool
    contacts: bool
    lone_law: str
    lone_solid: str
    chromatic: bool
    phases: frozenset[PhaseFunction]
    similarity: bool
    frozen: bool
    exact_variance: bool
    aovs: frozenset[Aov]
    sampler: Sampler

    @property
    def connections(self) -> bool:
        """True where paths connect to lights (next-event estimation)."""
        return bool(self.shaped_lights) or self.distant_lights or self.dome_image

    @property
    def intricate_lights(self) -> bool:
        """True where lights are looked at path by path: for their images, shapes or links."""
        is_dressed = self.dome_image or self.light_images or self.shaping or self.links
        return is_dressed or bool(self.shaped_lights & {"cylinder", "mesh"})

    @property
    def connects_in_lanes(self) -> bool:
        """True where what is between a path and a light is found for all lanes at once."""
        is_scalar = self.crossings or self.motion or self.instances or self.shading or self.intricate_lights
        return self.connections and not is_scalar

    @property
    def medium_kind(self) -> str:
        """How media are built into the kernel, a key of `integrator.media.KINDS`."""
        if not self.media:
            return "none"
        return "many" if self.looks_up_media else "lone"

    @property
    def looks_up_media(self) -> bool:
        """True where paths meet different media, or channels of one that differ, so that each path looks its own up."""
        return self.media and self.lone_law == ""

    @property
    def refracts(self) -> bool:
        """True where light enters media through surfaces."""
        return self.passes and self.media

    @property
    def faces(self) -> bool:
        """True where it matters which triangle of a mesh is met, and where on it."""
        return self.meshes and (self.shading or "mesh" in self.shaped_lights)

    @property
    def crossings(self) -> bool:
        """True where paths cross boundaries of media one by one."""
        return self.media and not self.lone_solid

    @property
    def phase_parameters(self) -> tuple[str, ...]:
        """The parameters that these phase functions have."""
        return tuple(name for name, kinds in PHASE_PARAMETERS.items() if self.phases & {*kinds})


@dataclass(frozen=True)
class Reason:
    """Why a part is in the kernel, or is left out.

    Args:
        part: of the kernel.
        built: whether it is there.
        why: what in the scene or the settings asks for it, or that nothing does.
    """

    part: str
    built: bool
    why: str


def required_features(scene: Scene, settings: RenderSettings) -> RenderFeatures:
    """The least that renders this scene with these settings.

    Raises:
        UnsupportedFeatureError: for a medium with the exact line variance that is to be replaced by a similar one.
    """
    filled = [shape for shape in scene.shapes if shape.medium is not None]
    media = [scene.media[shape.medium] for shape in filled if shape.medium is not None]
    surfaces = [shape.surface for shape in scene.shapes if shape.surface is not None]
    passes = any(surface.may_be_transparent for surface in surfaces)
    # What a path has passed through must be remembered along the ray, which only the general flight does.
    turning = _replaced_media(media, settings)
    chromatic = any(medium.is_chromatic or (bool(turning) and _differs_in_similar(medium)) for medium in media)
    is_lone = len(media) == 1 and not chromatic and not passes
    lone_law = media[0].line_law.kind if is_lone else ""
    hanging = solids_in_tree(scene.shapes)
    tried = filled if hanging else scene.shapes
    triangles = Mesh | Instances | MeshLight
    motion = scene.camera.closing is not None or any(moves(shape) for shape in scene.shapes)
    return RenderFeatures(
        solids=frozenset(shape.kind for shape in tried if isinstance(shape, Solid)),
        meshes=bool(hanging) or any(isinstance(item, triangles) for item in (*scene.shapes, *scene.lights)),
        instances=bool(hanging) or any(isinstance(shape, Instances) for shape in scene.shapes),
        solids_in_tree=bool(hanging),
        motion=motion,
        surfaces=bool(surfaces),
        shading=any(not surface.is_matte for surface in surfaces) or any(_has_normals(shape) for shape in scene.shapes),
        passes=passes,
        lens=not scene.camera.is_pinhole,
        varied_starts=bool(scene.shapes_around_starts(settings.width, settings.height)),
        shaped_lights=frozenset(_light_kind(light) for light in scene.lights) - {"distant", "dome"},
        distant_lights=any(isinstance(light, DistantLight) for light in scene.lights),
        environment=any(isinstance(light, DomeLight) and light.is_plain for light in scene.lights),
        dome_image=any(isinstance(light, DomeLight) and not light.is_plain for light in scene.lights),
        light_images=any(isinstance(light, AreaLight) and light.image is not None for light in scene.lights),
        shaping=any(light.shaping is not None for light in scene.lights),
        links=any(light.link is not None or light.shadow_link is not None for light in scene.lights),
        media=bool(media),
        contacts=bool(scene.neighbours),
        lone_law=lone_law,
        lone_solid=filled[0].kind if lone_law and isinstance(filled[0], Solid) and not moves(filled[0]) else "",
        chromatic=chromatic,
        phases=frozenset(medium.phase_function for medium in media),
        similarity=bool(turning),
        frozen=any(medium.freezes_paths for medium in media),
        exact_variance=any(law.kind == "exact_fbm" for medium in media for law in medium.channel_laws),
        aovs=_traced(settings, surfaces=bool(surfaces), motion=motion),
        sampler=settings.sampler,
    )


def _replaced_media(media: Sequence[Medium], settings: RenderSettings) -> list[Medium]:
    """Those that scatter unevenly, where the settings ask for similar ones."""
    if settings.similarity_order is None:
        return []
    for medium in media:
        if any(law.kind == "exact_fbm" for law in medium.channel_laws):
            raise UnsupportedFeatureError(
                f"{medium.name}: similarity_order = {settings.similarity_order} with the exact line variance; "
                "accepted: the asymptotic one"
            )
    return [medium for medium in media if medium.mean_cosine != 0]


def _differs_in_similar(medium: Medium) -> bool:
    """True where the channels of the similar medium differ in extinction: it keeps each one's absorption."""
    return len({channel.mean_extinction for channel in medium.similar_channels}) > 1


def _traced(settings: RenderSettings, *, surfaces: bool, motion: bool) -> frozenset[Aov]:
    """The planes to build for: without surfaces all normals are 0, and at rest all motion."""
    empty = frozenset() if surfaces else frozenset({Aov.NORMAL})
    return (settings.aovs & TRACED_AOVS) - empty - (frozenset() if motion else frozenset({Aov.MOTION}))


LIGHT_KINDS: dict[type[Light], str] = {
    DistantLight: "distant",
    DomeLight: "dome",
    SphereLight: "sphere",
    CylinderLight: "cylinder",
    MeshLight: "mesh",
}


def _light_kind(light: Light) -> str:
    return light.shape if isinstance(light, AreaLight) else LIGHT_KINDS[type(light)]


def _has_normals(shape: Shape) -> bool:
    mesh = shape.prototype if isinstance(shape, Instances) else shape
    return isinstance(mesh, Mesh) and mesh.surface is not None and mesh.normals is not None


def explain(scene: Scene, settings: RenderSettings) -> tuple[Reason, ...]:
    """What the kernel of a scene is built for and why, part by part."""
    features = required_features(scene, settings)
    filled = [shape for shape in scene.shapes if shape.medium is not None]
    media = [scene.media[s.medium] for s in filled if s.medium is not None]

    def with_property(holds: Callable[[Medium], bool]) -> list[str]:
        return sorted({medium.name for medium in media if holds(medium)})

    chromatic = with_property(
        lambda medium: medium.is_chromatic or (features.similarity and _differs_in_similar(medium))
    )
    frozen = with_property(lambda medium: medium.freezes_paths)
    exact = with_property(lambda medium: any(law.kind == "exact_fbm" for law in medium.channel_laws))

    def named(kinds: type | UnionType) -> list[str]:
        return [item.name for item in (*scene.shapes, *scene.lights) if isinstance(item, kinds)]

    if features.lone_law:
        law_why = f"{_named_all(filled)} is filled with the only medium, and its channels have one law"
    elif chromatic:
        law_why = f"the channels of {_listed(chromatic)} differ in extinction"
    else:
        law_why = f"{_named_all(filled)} are filled with media" if filled else "no shape is filled with a medium"
    domes = [light for light in scene.lights if isinstance(light, DomeLight)]
    dome_images = [dome.name for dome in domes if not dome.is_plain]
    shaped = AreaLight | SphereLight | CylinderLight | MeshLight
    lights = [*named(shaped | DistantLight), *dome_images]
    hanging = [solid.name for solid in solids_in_tree(scene.shapes)]
    moving = [shape.name for shape in scene.shapes if moves(shape)]
    if scene.camera.closing is not None:
        moving.append(scene.camera.name)
    return (
        Reason("spheres, cubes, cylinders", bool(features.solids), _why(named(Solid))),
        Reason("meshes", features.meshes, _why(named(Mesh | Instances | MeshLight))),
        Reason("instances", features.instances, _why(list(dict.fromkeys([*named(Instances), *hanging])))),
        Reason("solids in a tree", features.solids_in_tree, _why(hanging)),
        Reason("motion", features.motion, _why(moving)),
        Reason("surfaces", features.surfaces, _why([s.name for s in scene.shapes if s.surface is not None])),
        Reason(
            "surfaces that are more than matte",
            features.shading,
            _why(
                [s.name for s in scene.shapes if _has_normals(s) or (s.surface is not None and not s.surface.is_matte)]
            ),
        ),
        Reason(
            "surfaces that light passes",
            features.passes,
            _why([s.name for s in scene.shapes if s.surface is not None and s.surface.may_be_transparent]),
        ),
        Reason(
            "a camera beyond the pinhole", features.lens, scene.camera.name if features.lens else "nothing needs it"
        ),
        Reason(
            "camera rays that begin in media of their own",
            features.varied_starts,
            _why([shape.name for shape in scene.shapes_around_starts(settings.width, settings.height)]),
        ),
        Reason("media", features.media, _why([shape.name for shape in filled])),
        Reason(
            "bodies of one medium that may touch", features.contacts, _why([shape.name for shape in scene.neighbours])
        ),
        Reason(f"one law for all flights: {features.lone_law}".removesuffix(": "), bool(features.lone_law), law_why),
        Reason(
            "one chord through the medium",
            bool(features.lone_solid),
            f"{_named_all(filled)} is a convex solid, and nothing else is filled"
            if features.lone_solid
            else "boundaries are crossed one by one"
            if features.media
            else "no shape is filled with a medium",
        ),
        Reason(
            f"phase functions: {', '.join(sorted(features.phases))}".removesuffix(": "),
            features.media,
            _why(with_property(lambda medium: True)),
        ),
        Reason("channels of their own extinction", features.chromatic, _why(chromatic)),
        Reason(
            "similar media for long paths",
            features.similarity,
            _why(with_property(lambda medium: features.similarity and medium.mean_cosine != 0)),
        ),
        Reason("frozen paths", features.frozen, _why(frozen)),
        Reason("variance of finite segments", features.exact_variance, _why(exact)),
        Reason("connections to lights", features.connections, _why(lights)),
        Reason("lights with a shape", bool(features.shaped_lights), _why(named(shaped))),
        Reason("distant lights", features.distant_lights, _why(named(DistantLight))),
        Reason("even environment", features.environment, _why([dome.name for dome in domes if dome.is_plain])),
        Reason("environment to connect to", features.dome_image, _why(dome_images)),
        Reason(
            "images on lights",
            features.light_images,
            _why([light.name for light in scene.lights if isinstance(light, AreaLight) and light.image is not None]),
        ),
        Reason(
            "lights that emit unevenly",
            features.shaping,
            _why([light.name for light in scene.lights if light.shaping is not None]),
        ),
        Reason(
            "linked lights",
            features.links,
            _why([x.name for x in scene.lights if x.link is not None or x.shadow_link is not None]),
        ),
        *(
            Reason(f"plane: {aov}", aov in features.aovs, "asked for" if aov in features.aovs else "not asked for")
            for aov in Aov
            if aov in TRACED_AOVS
        ),
        Reason(f"sampler: {features.sampler}", True, "as the settings say"),
    )


def _why(names: Sequence[str]) -> str:
    return _listed(names) if names else "nothing needs it"


def _listed(names: Sequence[str]) -> str:
    shown = ", ".join(names[:NAMES_SHOWN])
    return shown if len(names) <= NAMES_SHOWN else f"{shown} and {len(names) - NAMES_SHOWN} more"


def _named_all(shapes: Sequence[Shape]) -> str:
    return _listed([shape.name for shape in shapes])

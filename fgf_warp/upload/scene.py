"""A scene on the device: what the kernels read of it, each kind of thing made by a module of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import warp as wp

from fgf_warp.device import camera as camera_device
from fgf_warp.device import drift, medium, numerics, surfaces
from fgf_warp.device.bvh import Bvh
from fgf_warp.device.lights import LightTables
from fgf_warp.device.shading import Shading
from fgf_warp.errors import UnsupportedFeatureError
from fgf_warp.integrator.program import Program
from fgf_warp.integrator.work import Limits
from fgf_warp.scene import (
    BLACK,
    MAX_CONTAINERS,
    Camera,
    Instances,
    Medium,
    Scene,
    Shape,
    Solid,
    count_of,
    drifts_of,
    shape_bounds,
    solids_in_tree,
    unit_axes,
)
from fgf_warp.settings import Aov, RenderSettings
from fgf_warp.upload.arrays import upload_array, upload_structs
from fgf_warp.upload.instances import upload_solids
from fgf_warp.upload.lights import build_device_lights, connected_lights, even_environment
from fgf_warp.upload.media import (
    LawTables,
    build_device_containers,
    build_device_medium,
    containers_around,
    indices_of_refraction,
    ior_around,
)
from fgf_warp.upload.meshes import build_device_meshes
from fgf_warp.upload.shading import build_device_shading


@dataclass(frozen=True, eq=False)
class UploadedScene:
    """A scene on a device.

    Args:
        data: the kernel's view of it, `Program.scene`.
        limits: the kernel's view of the settings, `Limits`.
        kept: what `data` holds the addresses of, so that it lives as long.
    """

    data: Any
    limits: Any
    kept: tuple[Any, ...]


def upload(
    scene: Scene,
    settings: RenderSettings,
    media_of_images: Sequence[Sequence[Medium]],
    seeds: Sequence[int],
    program: Program,
) -> UploadedScene:
    """Copies a scene to `settings.device`.

    Args:
        scene: what the images share.
        settings: how they are rendered.
        media_of_images: for each image what takes the place of the scene's media.
        seeds: of each image, in [0, 2^64).
        program: whose kernels render it, and have what they read of it.

    Returns:
        The scene as the kernels read it.

    Raises:
        UnsupportedFeatureError: for more than 32 shapes filled with media.
    """
    device = settings.device
    # A shape without surface and medium is nothing to light.
    shapes = [shape for shape in scene.shapes if shape.surface is not None or shape.medium is not None]
    containers = [shape for shape in shapes if shape.medium is not None]
    surfaced = [shape for shape in shapes if shape.surface is not None]
    _check_containers(containers, scene)
    hanging = set(solids_in_tree(shapes))
    solids = [shape for shape in shapes if isinstance(shape, Solid) and shape not in hanging]

    parts: dict[str, Any] = {}
    parts["camera"] = _camera(scene.camera, settings.width, settings.height)
    parts["environment"] = wp.vec3(*even_environment(scene))
    parts["solids"] = upload_solids(solids, shapes, device)
    filled = [k for k, solid in enumerate(solids) if solid.medium is not None]
    parts["lone_solid"] = filled[0] if filled else -1
    meshes = build_device_meshes(shapes, connected_lights(scene), device)
    parts["meshes"] = wp.array([meshes], dtype=Bvh, device=device)
    parts["motions"] = meshes.motions
    parts["surfaces"], parts["surface_of"] = _surfaces(surfaced, device)
    kept: list[Any] = [meshes]
    if program.features.shading:
        kept.append(build_device_shading(shapes, containers, device))
        parts["shading"] = wp.array(kept[-1:], dtype=Shading, device=device)
    _add_media(parts, scene, settings, media_of_images, containers)
    if Aov.MOTION in settings.aovs:
        parts["surface_drifts"] = _drifts(surfaced, device)
        parts["container_drifts"] = _drifts(containers, device)
    parts["lights"], light_tables = build_device_lights(scene, containers, device)
    parts["light_tables"] = wp.array([light_tables], dtype=LightTables, device=device)
    kept += [
        *_add_surroundings(parts, scene, settings, containers, is_varied=program.features.varied_starts),
        light_tables,
    ]
    parts["seeds"] = wp.array(np.array(seeds, dtype=np.uint64), dtype=wp.uint64, device=device)

    data = program.scene()
    for name in program.scene.vars:
        setattr(data, name, parts[name])
    limits = Limits()
    limits.max_depth = settings.max_depth
    limits.roulette_depth = settings.roulette_depth
    return UploadedScene(data, limits, tuple(kept))


def _check_containers(containers: Sequence[Shape], scene: Scene) -> None:
    if len(containers) > MAX_CONTAINERS:
        raise UnsupportedFeatureError(
            f"{scene.source}: {len(containers)} shapes are filled with media, of meshes each layer of shells that "
            f"overlap or touch; accepted: at most {MAX_CONTAINERS}"
        )


def _add_media(
    parts: dict[str, Any],
    scene: Scene,
    settings: RenderSettings,
    media_of_images: Sequence[Sequence[Medium]],
    containers: Sequence[Shape],
) -> None:
    """Adds the media of all images, what their laws look up, and the containers they fill."""
    rows = LawTables()
    media = [
        build_device_medium(item, index, scene, settings, rows)
        for own in media_of_images
        for index, item in enumerate(own)
    ]
    parts["media"] = wp.array(media, dtype=medium.Medium, device=settings.device)
    parts["media_count"] = len(scene.media)
    parts["first_medium"] = 0
    parts["tables"] = rows.upload(settings.device)
    filled = build_device_containers(containers, scene, indices_of_refraction(containers))
    parts["containers"] = wp.array(filled, dtype=medium.Container, device=settings.device)


def _add_surroundings(
    parts: dict[str, Any], scene: Scene, settings: RenderSettings, containers: Sequence[Shape], *, is_varied: bool
) -> list[Any]:
    """Adds what camera rays begin in: the same for all of them, or the boundaries to find it by.

    Returns:
        What these parts hold the addresses of.
    """
    low, high = scene.camera.start_bounds(settings.width, settings.height)
    inside = containers_around((low + high) / 2, containers)
    parts["camera_inside"] = wp.uint32(inside)
    parts["contact_rounding"] = scene.contact_rounding
    parts["camera_ior"] = ior_around(inside, containers, scene)
    if not is_varied:
        return []
    lows, highs = zip(*(shape_bounds(shape) for shape in containers), strict=True)
    low, high = np.min(lows, axis=0), np.max(highs, axis=0)
    parts["media_center"], parts["media_radius"] = wp.vec3(*(low + high) / 2), float(np.linalg.norm(high - low))
    boundaries = build_device_meshes([_bare(shape) for shape in containers], [], settings.device)
    parts["boundaries"] = wp.array([boundaries], dtype=Bvh, device=settings.device)
    return [boundaries]


def _bare(shape: Shape) -> Shape:
    """The shape as a mere boundary."""
    if shape.surface is None:
        return shape
    if isinstance(shape, Instances):
        return replace(shape, prototype=replace(shape.prototype, surface=None))
    return replace(shape, surface=None)


def _drifts(shapes: Sequence[Shape], device: str) -> wp.array:
    """How each place of each shape moves while the shutter is open, (n,) `Drift`."""
    moved = np.concatenate([np.zeros((0, 3, 4)), *map(drifts_of, shapes)])
    return upload_structs(drift.Drift, device, slope=moved[:, :, :3], offset=moved[:, :, 3])


def _surfaces(shapes: Sequence[Shape], device: str) -> tuple[wp.array, wp.array]:
    """What surfaces are where they are matte; what varies over them is read where they are shaded.

    Returns:
        The `Surface` of each shape, (n,), and for each place of all shapes the index of its surface, (m,) int32.
    """
    colors: list[Any] = [
        (shape.surface.diffuse, shape.surface.emission) if shape.surface and shape.surface.is_matte else (BLACK, BLACK)
        for shape in shapes
    ]
    diffuse, emission = np.array(colors, dtype=np.float64).reshape(-1, 2, 3).swapaxes(0, 1)
    links = np.array([shape.light_links for shape in shapes], dtype=np.uint32)
    surface_of = np.repeat(np.arange(len(shapes), dtype=np.int32), [count_of(shape) for shape in shapes])
    return (
        upload_structs(surfaces.Surface, device, diffuse=diffuse, emission=emission, light_links=links),
        upload_array(surface_of, int, device),
    )


def _camera(camera: Camera, width: int, height: int) -> Any:
    """The device's `Camera` for an image of so many pixels."""
    left, right, bottom, top = camera.window(width, height)
    closing = camera.camera_to_world if camera.closing is None else camera.closing
    near, far = camera.clipping_range
    result = camera_device.Camera()
    result.position, result.closing_position = wp.vec3(*camera.position), wp.vec3(*closing[:3, 3])
    result.right, result.up, result.forward = _camera_axes(camera.camera_to_world)
    result.closing_right, result.closing_up, result.closing_forward = _camera_axes(closing)
    result.left_edge, result.top_edge = left, top
    result.pixel_width, result.pixel_height = (right - left) / width, (top - bottom) / height
    result.width = width
    result.is_orthographic = int(camera.projection == "orthographic")
    result.lens_radius = camera.lens_radius
    result.nearness = 1 / camera.focus_distance if camera.has_lens else 0.0
    result.near, result.far = near, min(far, float(numerics.INFINITE))
    return result


def _camera_axes(matrix: np.ndarray) -> tuple[wp.vec3, wp.vec3, wp.vec3]:
    """Unit vectors to the right, up and forward in the world."""
    axes = unit_axes(matrix)
    return wp.vec3(*axes[:, 0]), wp.vec3(*axes[:, 1]), wp.vec3(*-axes[:, 2])

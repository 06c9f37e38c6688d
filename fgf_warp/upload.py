"""From a scene to the device: structs, triangle meshes, and tables from theory."""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import warp as wp

from fgf_warp.device import camera as camera_device
from fgf_warp.device import drift, law, medium, numerics, phase, surfaces, tables
from fgf_warp.device.bvh import Bvh
from fgf_warp.device.lights import LightTables
from fgf_warp.device.shading import Shading
from fgf_warp.errors import UnsupportedFeatureError
from fgf_warp.integrator.kinds import LAW_KINDS
from fgf_warp.integrator.program import Program
from fgf_warp.integrator.work import Limits
from fgf_warp.scene import (
    BLACK,
    MAX_CONTAINERS,
    Camera,
    DomeLight,
    Instances,
    Medium,
    Scene,
    Shape,
    Solid,
    count_of,
    drifts_of,
    encloses,
    shape_bounds,
    solids_in_tree,
    unit_axes,
)
from fgf_warp.settings import Aov, RenderSettings
from fgf_warp.theory import fbm, kernels
from fgf_warp.theory.law import LineLaw
from fgf_warp.theory.mixture import RateMixture, mix_exact_rates, mix_rates
from fgf_warp.upload_instances import is_open, upload_array, upload_solids, upload_structs
from fgf_warp.upload_lights import build_device_lights, connected_lights
from fgf_warp.upload_meshes import build_device_meshes
from fgf_warp.upload_shading import build_device_shading, indices_of_refraction

EXTINCTION_FLOOR = 1e-30
"""Stands for a vanishing extinction, whose free flights are beyond every scene."""


@dataclass(frozen=True, eq=False)
class UploadedScene:
    """A scene on a device.

    Args:
        data: the kernel's view of it.
        limits: the kernel's view of the settings.
        kept: what `data` has the addresses of.
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
        seeds: of each image.
        program: whose kernels render it.

    Raises:
        UnsupportedFeatureError: for more than 32 shapes filled with media.
    """
    device = settings.device
    # A shape without surface and medium is nothing to light.
    shapes = [shape for shape in scene.shapes if shape.surface is not None or shape.medium is not None]
    containers = [shape for shape in shapes if shape.medium is not None]
    if len(containers) > MAX_CONTAINERS:
        raise UnsupportedFeatureError(
            f"{scene.source}: {len(containers)} shapes are filled with media, of meshes each layer of shells that "
            f"overlap or touch; accepted: at most {MAX_CONTAINERS}"
        )
    hanging = set(solids_in_tree(shapes))
    solids = [shape for shape in shapes if isinstance(shape, Solid) and shape not in hanging]
    rows = LawTables()
    media = [_medium(item, index, scene, settings, rows) for own in media_of_images for index, item in enumerate(own)]

    features, parts = program.features, dict[str, Any]()
    parts["camera"] = _camera(scene.camera, settings.width, settings.height)
    parts["environment"] = wp.vec3(*_environment(scene))
    parts["solids"] = upload_solids(solids, shapes, device)
    filled = [k for k, solid in enumerate(solids) if solid.medium is not None]
    parts["lone_solid"] = filled[0] if filled else -1
    meshes = build_device_meshes(shapes, connected_lights(scene), device)
    parts["meshes"] = wp.array([meshes], dtype=Bvh, device=device)
    parts["motions"] = meshes.motions
    surfaced = [shape for shape in shapes if shape.surface is not None]
    parts["surfaces"], parts["surface_of"] = _surfaces(surfaced, device)
    kept: list[Any] = [meshes]
    if features.shading:
        kept.append(build_device_shading(shapes, containers, device))
        parts["shading"] = wp.array(kept[-1:], dtype=Shading, device=device)
    parts["media"] = wp.array(media, dtype=medium.Medium, device=device)
    parts["media_count"] = len(scene.media)
    parts["first_medium"] = 0
    parts["tables"] = rows.upload(device)
    iors = indices_of_refraction(containers)
    parts["containers"] = wp.array(_containers(containers, scene, iors), dtype=medium.Container, device=device)
    if Aov.MOTION in settings.aovs:
        parts["surface_drifts"] = _drifts(surfaced, device)
        parts["container_drifts"] = _drifts(containers, device)
    parts["lights"], light_tables = build_device_lights(scene, containers, device)
    parts["light_tables"] = wp.array([light_tables], dtype=LightTables, device=device)
    low, high = scene.camera.start_bounds(settings.width, settings.height)
    inside = containers_around((low + high) / 2, containers)
    parts["camera_inside"] = wp.uint32(inside)
    parts["contact_rounding"] = scene.contact_rounding
    parts["camera_ior"] = _ior_around(inside, containers, scene)
    if features.varied_starts:
        lows, highs = zip(*(shape_bounds(shape) for shape in containers), strict=True)
        low, high = np.min(lows, axis=0), np.max(highs, axis=0)
        parts["media_center"], parts["media_radius"] = wp.vec3(*(low + high) / 2), float(np.linalg.norm(high - low))
        kept.append(build_device_meshes([_bare(shape) for shape in containers], [], device))
        parts["boundaries"] = wp.array(kept[-1:], dtype=Bvh, device=device)
    parts["seeds"] = wp.array(np.array(seeds, dtype=np.uint64), dtype=wp.uint64, device=device)
    data = program.scene()
    for name in program.scene.vars:
        setattr(data, name, parts[name])

    limits = Limits()
    limits.max_depth = settings.max_depth
    limits.roulette_depth = settings.roulette_depth
    return UploadedScene(data, limits, (*kept, light_tables))


def _bare(shape: Shape) -> Shape:
    """The shape as a mere boundary."""
    if shape.surface is None:
        return shape
    if isinstance(shape, Instances):
        return replace(shape, prototype=replace(shape.prototype, surface=None))
    return replace(shape, surface=None)


def containers_around(point: np.ndarray, containers: Sequence[Shape]) -> int:
    """Bits of the containers that a point, (3,) float64, lies in."""
    return sum(1 << bit for bit, shape in enumerate(containers) if encloses(shape, point))


fit_flight = cache(kernels.fit_flight)
tabulate_flights = cache(fbm.tabulate_flights)


class LawTables:
    """Rows that laws look up, all in one array of the device."""

    def __init__(self) -> None:
        self._blocks: list[np.ndarray] = []
        self._count = 0
        self._known: dict[Hashable, Any] = {}

    def add(self, key: Hashable, *columns: np.ndarray) -> Any:
        """A table of up to three columns; of equal keys there is one."""
        if key not in self._known:
            table = tables.Table()
            table.first, table.count = self._count, len(columns[0])
            self._blocks.append(np.column_stack([*columns, *(np.zeros(table.count) for _ in range(3 - len(columns)))]))
            self._count += table.count
            self._known[key] = table
        return self._known[key]

    def upload(self, device: str) -> wp.array:
        """The rows, (n,) vec3."""
        rows = np.concatenate(self._blocks) if self._blocks else np.zeros((0, 3))
        return wp.array(rows.astype(np.float32), dtype=wp.vec3, device=device)


def build_device_law(line: LineLaw, reciprocal: bool, rows: LawTables | None = None, longest_depth: float = 0.0) -> Any:
    """The device's view of a line law.

    Args:
        line: what to describe.
        reciprocal: True for Tmm and Tms from medium vertices, False for the renewal transport.
        rows: where a law with the exact variance has its flights.
        longest_depth: u up to which they are needed.
    """
    result = law.Law()
    result.b = line.b
    result.kappa = line.kappa
    result.reciprocal = int(reciprocal)
    result.kind = LAW_KINDS[line.kind]
    if line.is_exponential:
        result.rate = float(kernels.log1p_ratio(line.kappa))
        return result
    result.ln_kappa = math.log(line.kappa)
    result.rate = 1.0
    if line.kind == "fractional":
        fit = fit_flight(line.b)
        result.fit_offset = math.log(line.kappa) + math.log((1 - line.b) / 2)
        result.fit_bend, result.fit_scale = fit.bend, fit.scale
        result.fit = law.Fit(*fit.coefficients)
    exact = line.exact_fbm
    if exact is not None and rows is not None:
        result.two_hurst, result.outer_depth = 2 * exact.hurst, exact.outer_depth
        result.flights = _flights(exact, longest_depth, rows, from_medium=False)
        result.flights_from_medium = _flights(exact, longest_depth, rows, from_medium=True)
    return result


def _flights(line: fbm.ExactFbm, farthest: float, rows: LawTables, *, from_medium: bool) -> Any:
    flights = tabulate_flights(line, farthest, from_medium=from_medium)
    result = tables.Flights()
    result.table = rows.add((line, farthest, from_medium), flights.ln_flight, flights.slope)
    result.start, result.step = flights.start, flights.step
    result.largest_exponent = flights.largest_exponent
    return result


def _medium(item: Medium, index: int, scene: Scene, settings: RenderSettings, rows: LawTables) -> Any:
    reciprocal = item.resolved_transport != "renewal"
    # Of what fills nothing no flight is looked up and no path frozen.
    needs_tables = item.line_variance == "exact" or item.freezes_paths
    longest = scene.longest_segment(index) if needs_tables else None
    channels = []
    for line in item.channel_laws:
        longest_depth = line.mean_extinction * (longest or 0.0)
        channels.append(build_device_law(line, reciprocal, rows if longest else None, longest_depth))
        if item.freezes_paths and longest:
            mixture = _mixture(line, longest_depth)
            channels[-1].rates = rows.add((line, longest_depth, "rates"), np.cumsum(mixture.weights), mixture.rates)
    result = medium.Medium()
    result.index = index
    result.extinction = wp.vec3(*(max(line.mean_extinction, EXTINCTION_FLOOR) for line in item.channel_laws))
    result.albedo = wp.vec3(*item.albedo)
    result.phase = _phase(item)
    result.law, result.law_green, result.law_blue = channels
    result.frozen_share = scene.frozen_share(index, item)
    if settings.similarity_order is not None:
        _add_similar(result, item, settings.similarity_order)
    return result


def _add_similar(result: Any, item: Medium, order: int) -> None:
    similar = item.similar_channels
    result.similarity_order = order
    result.similar_extinction = wp.vec3(*(max(channel.mean_extinction, EXTINCTION_FLOOR) for channel in similar))
    result.similar_albedo = wp.vec3(*(channel.albedo for channel in similar))
    result.similar_kappa = wp.vec3(*(channel.kappa for channel in similar))
    result.similar_ln_kappa = wp.vec3(*(math.log(channel.kappa) if channel.kappa > 0 else 0.0 for channel in similar))
    result.similar_rate = wp.vec3(
        *(
            float(kernels.log1p_ratio(channel.kappa)) if line.is_exponential else 1.0
            for line, channel in zip(item.channel_laws, similar, strict=True)
        )
    )


def _phase(item: Medium) -> Any:
    result = phase.Phase()
    result.asymmetry, result.draine_alpha = item.asymmetry, item.draine_alpha
    result.back_asymmetry, result.back_weight = item.back_asymmetry, item.back_weight
    return result


def _mixture(line: LineLaw, longest_depth: float) -> RateMixture:
    if line.is_exponential:
        return RateMixture(np.array([float(kernels.log1p_ratio(line.kappa))]), np.ones(1), 0.0)
    if line.exact_fbm is not None:
        return mix_exact_rates(line.exact_fbm, longest_depth)
    return mix_rates(line.b, line.kappa)


def _containers(shapes: Sequence[Shape], scene: Scene, iors: Sequence[float]) -> list[Any]:
    rows, met = [], set()
    for bit, shape in enumerate(shapes):
        row = _container(shape, scene, iors)
        # Each body has rates of its own; 0 is the address of what belongs to no medium.
        row.rates = 1 + (len(scene.media) + bit if shape.medium in met else row.medium)
        met.add(shape.medium)
        rows.append(row)
    return rows


def _container(shape: Shape, scene: Scene, iors: Sequence[float]) -> Any:
    assert shape.medium is not None
    result = medium.Container()
    result.medium = shape.medium
    result.priority = scene.media[shape.medium].priority
    result.light_links = shape.light_links
    if is_open(shape) and shape.surface is not None:
        result.ior, result.ior_number = shape.surface.ior, iors.index(shape.surface.ior)
    return result


def _ior_around(inside: int, containers: Sequence[Shape], scene: Scene) -> float:
    """Index of refraction within these containers, as `device.medium.ior_at` has it."""
    around = [s for bit, s in enumerate(containers) if inside >> bit & 1 and is_open(s)]
    nearest = max(around, key=lambda s: scene.media[s.medium or 0].priority, default=None)
    return 1.0 if nearest is None or nearest.surface is None else nearest.surface.ior


def _drifts(shapes: Sequence[Shape], device: str) -> wp.array:
    moved = np.concatenate([np.zeros((0, 3, 4)), *map(drifts_of, shapes)])
    return upload_structs(drift.Drift, device, slope=moved[:, :, :3], offset=moved[:, :, 3])


def _surfaces(shapes: Sequence[Shape], device: str) -> tuple[wp.array, wp.array]:
    """Those of each shape, and which of them each place's is; what varies is read where surfaces are shaded."""
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
    axes = unit_axes(matrix)
    return wp.vec3(*axes[:, 0]), wp.vec3(*axes[:, 1]), wp.vec3(*-axes[:, 2])


def _environment(scene: Scene) -> np.ndarray:
    """Radiance of all domes that are the same everywhere."""
    domes = [light.radiance for light in scene.lights if isinstance(light, DomeLight) and light.is_plain]
    return np.sum(domes, axis=0) if domes else np.zeros(3)

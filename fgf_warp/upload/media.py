"""Media from a scene to the device: their laws with the tables that these look up, and the containers they fill."""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from functools import cache
from typing import Any

import numpy as np
import warp as wp

from fgf_warp.device import law, medium, phase, tables
from fgf_warp.integrator.kinds import LAW_KINDS
from fgf_warp.scene import PHASE_PARAMETERS, Medium, Scene, Shape, encloses
from fgf_warp.settings import RenderSettings
from fgf_warp.theory import fbm, kernels
from fgf_warp.theory.law import LineLaw
from fgf_warp.theory.mixture import RateMixture, mix_exact_rates, mix_rates
from fgf_warp.upload.instances import is_open

EXTINCTION_FLOOR = 1e-30
"""Stands for a vanishing extinction [1/stage unit], whose free flights are beyond every scene."""

fit_flight = cache(kernels.fit_flight)
tabulate_flights = cache(fbm.tabulate_flights)


class LawTables:
    """Rows that laws look up, all in one array of the device."""

    def __init__(self) -> None:
        self._blocks: list[np.ndarray] = []
        self._count = 0
        self._known: dict[Hashable, Any] = {}

    def add(self, key: Hashable, *columns: np.ndarray) -> Any:
        """Adds a table unless there is one of this key.

        Args:
            key: equal for equal tables.
            *columns: one to three, (n,) each.

        Returns:
            The device's `Table`: where its rows are.
        """
        if key not in self._known:
            table = tables.Table()
            table.first, table.count = self._count, len(columns[0])
            self._blocks.append(np.column_stack([*columns, *(np.zeros(table.count) for _ in range(3 - len(columns)))]))
            self._count += table.count
            self._known[key] = table
        return self._known[key]

    def upload(self, device: str) -> wp.array:
        """The rows of all tables, (n,) vec3."""
        rows = np.concatenate(self._blocks) if self._blocks else np.zeros((0, 3))
        return wp.array(rows.astype(np.float32), dtype=wp.vec3, device=device)


def build_device_medium(item: Medium, index: int, scene: Scene, settings: RenderSettings, rows: LawTables) -> Any:
    """The device's view of a medium.

    Args:
        item: what to describe.
        index: its place among the scene's media.
        scene: whose shapes it fills.
        settings: how it is rendered.
        rows: to add to what its laws look up.

    Returns:
        `device.medium.Medium`.
    """
    reciprocal = item.resolved_transport != "renewal"
    # In a medium that fills nothing no flight is looked up and no path is frozen.
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


def build_device_law(line: LineLaw, reciprocal: bool, rows: LawTables | None = None, longest_depth: float = 0.0) -> Any:
    """The device's view of a line law.

    Args:
        line: what to describe.
        reciprocal: True for Tmm and Tms from medium vertices, False for the renewal transport.
        rows: to add to the flights of a law with the exact variance; None where none are drawn.
        longest_depth: mean optical depth up to which these flights are needed, >= 0.

    Returns:
        `device.law.Law`.
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
    """The device's `Flights` up to the mean optical depth `farthest`."""
    flights = tabulate_flights(line, farthest, from_medium=from_medium)
    result = tables.Flights()
    result.table = rows.add((line, farthest, from_medium), flights.ln_flight, flights.slope)
    result.start, result.step = flights.start, flights.step
    result.largest_exponent = flights.largest_exponent
    return result


def _mixture(line: LineLaw, longest_depth: float) -> RateMixture:
    """The rates, relative to the mean extinction, at which paths are frozen."""
    if line.is_exponential:
        return RateMixture(np.array([float(kernels.log1p_ratio(line.kappa))]), np.ones(1), 0.0)
    if line.exact_fbm is not None:
        return mix_exact_rates(line.exact_fbm, longest_depth)
    return mix_rates(line.b, line.kappa)


def _phase(item: Medium) -> Any:
    result = phase.Phase()
    for parameter in PHASE_PARAMETERS:
        setattr(result, parameter, getattr(item, parameter))
    return result


def _add_similar(result: Any, item: Medium, order: int) -> None:
    """Adds the similar medium, which a path sees after `order` scattering events."""
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


def build_device_containers(shapes: Sequence[Shape], scene: Scene, iors: Sequence[float]) -> list[Any]:
    """The device's view of what media fill.

    Args:
        shapes: filled with media, in the order of their bits.
        scene: whose media they are.
        iors: indices of refraction, of which each container's is one; see `indices_of_refraction`.

    Returns:
        A `device.medium.Container` for each shape.
    """
    containers, seen = [], set()
    for bit, shape in enumerate(shapes):
        container = _container(shape, scene, iors)
        # Each body has rates of its own; 0 is the address of what belongs to no medium.
        container.rates = 1 + (len(scene.media) + bit if shape.medium in seen else container.medium)
        seen.add(shape.medium)
        containers.append(container)
    return containers


def _container(shape: Shape, scene: Scene, iors: Sequence[float]) -> Any:
    assert shape.medium is not None
    result = medium.Container()
    result.medium = shape.medium
    result.priority = scene.media[shape.medium].priority
    result.light_links = shape.light_links
    if is_open(shape) and shape.surface is not None:
        result.ior, result.ior_number = shape.surface.ior, iors.index(shape.surface.ior)
    return result


def containers_around(point: np.ndarray, containers: Sequence[Shape]) -> int:
    """Bits of the containers that a point, (3,) float64, lies in."""
    return sum(1 << bit for bit, shape in enumerate(containers) if encloses(shape, point))


def ior_around(inside: int, containers: Sequence[Shape], scene: Scene) -> float:
    """Index of refraction within the containers of these bits, as `device.medium.ior_at` has it; 1 in empty space."""
    around = [s for bit, s in enumerate(containers) if inside >> bit & 1 and is_open(s)]
    nearest = max(around, key=lambda s: scene.media[s.medium or 0].priority, default=None)
    return 1.0 if nearest is None or nearest.surface is None else nearest.surface.ior


def indices_of_refraction(containers: Sequence[Shape]) -> list[float]:
    """That of empty space, 1, and then the different ones of media that light is refracted into."""
    found = dict.fromkeys([1.0])
    found |= dict.fromkeys(s.surface.ior for s in containers if is_open(s) and s.surface is not None)
    return list(found)

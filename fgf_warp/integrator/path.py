"""What a path carries: one table, from which its struct and its rows in a pool are made.

A pool keeps its paths in one array, a row of `LANES` floats for each number of a path. The kernel makes that array
itself from a pointer: its stride is then known when it is compiled, and loops over lanes become vector code. (The
stride of an array argument is known at run time only, and an index that might be negative is wrapped; each alone keeps
such a loop scalar.) Loading and storing a whole path costs nothing: what a stage does not use is not loaded, and what
it does not change is not stored.
"""

from functools import cache
from typing import Any, NamedTuple

import warp as wp

from fgf_warp.device.geometry import Hit, Start
from fgf_warp.device.law import NOT_FROZEN
from fgf_warp.device.phase import Phase
from fgf_warp.features import RenderFeatures
from fgf_warp.integrator.planes import PLANE_ROWS
from fgf_warp.integrator.rows import LANES, Needs, Row, literal, make_function, make_struct, places

CAMERA_RAY = wp.constant(-1.0)
"""Stands for the pdf of a direction that no light sampling competes with."""
ALL_LINKS = wp.constant(wp.uint32(0xFFFFFFFF))
"""Link bits of what all lights shine on."""


def has_phase(parameter: str) -> Needs:
    """Needed where media differ and their phase functions have this parameter."""
    return lambda f: f.looks_up_media and parameter in f.phase_parameters


NESTED = {"start": Start, "hit": Hit, "phase": Phase}
"""Structs of the device that a path holds; the rows with a dot are those of their fields that outlive a stage."""

PATH = (
    # Its address, and whether it goes on.
    Row("pixel", int, "index in the image; -1 in a lane that has none"),
    Row("row", int, "of the pixel, from the top"),
    Row("column", int, "of the pixel, from the left"),
    Row("sample", int, "number less `end_sample`, so -1 for the last one of the pixel; 1 in a lane that is done"),
    Row("end_sample", int, "the number after that of the pixel's last sample in this launch"),
    Row("shift_x", int, "of the pixel's lattice", lambda f: f.sampler == "lattice"),
    Row("shift_y", int, "likewise", lambda f: f.sampler == "lattice"),
    Row("sample_index", int, "the sample's number with its bits reversed: the address of random numbers"),
    Row("alive", int, "1 until the path ends", initial=1),
    Row("bounce", int, "events so far, crossings of boundaries included: the address of random numbers"),
    Row("depth", int, "scattering events so far"),
    Row("truncated", int, "1 where a bound on its length ended it"),
    # The ray.
    Row("origin", wp.vec3, "of the ray [stage unit]"),
    Row("direction", wp.vec3, "of the ray, a unit vector"),
    Row("start.t_min", float, "distance of the last crossing on the ray [stage unit]", lambda f: f.crossings),
    Row("start.inside", wp.uint32, "containers around the path, one bit each", lambda f: f.media),
    Row("start.crossed", int, "the container last crossed on the ray, or -1", lambda f: f.meshes, initial=-1),
    Row("start.slack", float, "how far rounding may have put the origin across a face", lambda f: f.meshes),
    Row("start.passed", float, "distance of the surface last passed straight", lambda f: f.passes),
    Row("start.time", float, "in [0, 1), from the opening of the shutter to its closing", lambda f: f.motion),
    Row("start.entered", wp.uint32, "containers entered within rounding of here", lambda f: f.contacts),
    Row("crossings", int, "boundaries crossed since the last scattering event", lambda f: f.crossings),
    # What it brings to its pixel.
    Row("throughput", wp.vec3, "per channel", initial=1.0),
    Row("radiance", wp.vec3, "found so far"),
    Row("alpha", float, "1 where it was scattered or met a light"),
    Row("eta_scale", float, "square of the index of refraction here over that at the camera: throughput is of L / n^2",
        lambda f: f.refracts, initial=1.0),
    # The medium that it is in, and its flight there.
    Row("xi", wp.vec4, "random numbers of this event: flight, roulette, and two for the new direction"),
    Row("flight", float, "distance to the next scattering event, were the medium unbounded [stage unit]"),
    Row("medium", int, "that it flies in, or -1", lambda f: f.crossings, initial=-1),
    Row("segment", float, "distance on the ray at which it entered the medium", lambda f: f.looks_up_media),
    Row("flight_continues", int, "1: what was crossed did not change the medium, and the flight goes on",
        lambda f: f.looks_up_media),
    Row("from_medium", int, "1: the segment began at a medium vertex, and its flight remembers the last one",
        lambda f: f.media, lives=lambda f: f.lone_law != "exponential"),
    Row("rates", wp.vec3, "per channel, at which the path is frozen in its medium, or NOT_FROZEN",
        lambda f: f.frozen, initial=NOT_FROZEN),
    Row("body", int, "the container that it came into its medium by, whose `rates` it has; -1: not yet known",
        lambda f: f.frozen and f.looks_up_media, initial=-1),
    Row("t_in", float, "distance at which the ray enters the lone solid", lambda f: bool(f.lone_solid)),
    Row("t_out", float, "distance at which it leaves it", lambda f: bool(f.lone_solid)),
    Row("channel", int, "whose law the flights are sampled from", lambda f: f.chromatic),
    Row("length", float, "of the flight from the start of its segment: not rounded as `flight` less `segment` is",
        lambda f: f.chromatic),
    Row("channel_pdfs", wp.vec3, "density of its flights under each channel, over that under `channel`",
        lambda f: f.chromatic, initial=1.0),
    *(Row(f"phase.{name}", float, "of the medium at the event", has_phase(name)) for name in Phase.vars),
    # What it meets.
    Row("hit.t", float, "distance [stage unit]"),
    Row("hit.kind", int, "MISS, BOUNDARY, SURFACE or LIGHT"),
    Row("hit.item", int, "which of them"),
    Row("hit.normal", wp.vec3, "unit outward normal", lambda f: f.surfaces),
    Row("hit.face", int, "triangle of a mesh, or -1", lambda f: f.faces),
    Row("hit.u", float, "weight of the triangle's second corner", lambda f: f.faces),
    Row("hit.v", float, "of its third", lambda f: f.faces),
    Row("emitted", wp.vec3, "radiance from what is met, or from lights beyond all, times its mis_weight",
        lambda f: f.surfaces or f.connections),
    Row("albedo", wp.vec3, "of the surface that is met, or where media differ, of the medium",
        lambda f: f.surfaces or f.looks_up_media),
    Row("passes_straight", int, "1: the surface that is met lets it pass", lambda f: f.passes),
    Row("transmits", int, "1: it is scattered to the other side of the surface", lambda f: f.refracts),
    Row("incoming", wp.vec3, "throughput before the surface", lambda f: f.shading and f.connections),
    # Where it goes on.
    Row("scatters", int, "SURFACE or BOUNDARY (in a medium) where this event scatters the path on, else MISS",
        lives=lambda f: f.connections),
    Row("wi", wp.vec3, "the new direction", lives=lambda f: f.connections or f.shading),
    Row("pdf_direction", float, "pdf_solid_angle with which it last scattered, at the ray's origin",
        lambda f: f.connections or f.shading, initial=CAMERA_RAY),
    Row("links", wp.uint32, "of the shape where it last scattered: which linked lights shine there",
        lambda f: f.links, initial=ALL_LINKS),
    Row("to_light", wp.vec3, "direction of the connection", lambda f: f.connections,
        lives=lambda f: f.connects_in_lanes),
    Row("light_distance", float, "length of the connection", lambda f: f.connections,
        lives=lambda f: f.connects_in_lanes),
    Row("light_share", wp.vec3, "radiance that the connection would bring through empty space; 0 where it is blocked",
        lambda f: f.connections, lives=lambda f: f.connects_in_lanes),
    *PLANE_ROWS,
)  # fmt: skip


class PathRecord(NamedTuple):
    """A path of a kernel.

    Args:
        struct: `Path`.
        newborn: the function () -> Path with the initial values.
        load: the function (lanes, i) -> Path, of lane i.
        store: the function (lanes, i, path).
        float_count: length of the array `lanes`.
    """

    struct: Any
    newborn: Any
    load: Any
    store: Any
    float_count: int


@wp.func(inline=True)
def get(lanes: wp.array(dtype=float), row: int, i: int) -> float:
    """A float of lane i."""
    return lanes[row * LANES + i]


@wp.func(inline=True)
def get_int(lanes: wp.array(dtype=float), row: int, i: int) -> int:
    """An integer of lane i."""
    return wp.cast(lanes[row * LANES + i], wp.int32)


@wp.func(inline=True)
def get3(lanes: wp.array(dtype=float), row: int, i: int) -> wp.vec3:
    """A vector of lane i."""
    at = row * LANES + i
    return wp.vec3(lanes[at], lanes[at + LANES], lanes[at + 2 * LANES])


@wp.func(inline=True)
def get4(lanes: wp.array(dtype=float), row: int, i: int) -> wp.vec4:
    """A vector of lane i."""
    at = row * LANES + i
    return wp.vec4(lanes[at], lanes[at + LANES], lanes[at + 2 * LANES], lanes[at + 3 * LANES])


@wp.func(inline=True)
def put(lanes: wp.array(dtype=float), row: int, i: int, value: float):
    """Sets a float of lane i."""
    lanes[row * LANES + i] = value


@wp.func(inline=True)
def put_int(lanes: wp.array(dtype=float), row: int, i: int, value: int):
    """Sets an integer of lane i."""
    lanes[row * LANES + i] = wp.cast(value, wp.float32)


@wp.func(inline=True)
def put3(lanes: wp.array(dtype=float), row: int, i: int, value: wp.vec3):
    """Sets a vector of lane i."""
    at = row * LANES + i
    lanes[at] = value[0]
    lanes[at + LANES] = value[1]
    lanes[at + 2 * LANES] = value[2]


@wp.func(inline=True)
def put4(lanes: wp.array(dtype=float), row: int, i: int, value: wp.vec4):
    """Sets a vector of lane i."""
    at = row * LANES + i
    lanes[at] = value[0]
    lanes[at + LANES] = value[1]
    lanes[at + 2 * LANES] = value[2]
    lanes[at + 3 * LANES] = value[3]


GETTERS = {float: "get", int: "get_int", wp.uint32: "get_int", wp.vec3: "get3", wp.vec4: "get4"}
PUTTERS = {float: "put", int: "put_int", wp.uint32: "put_int", wp.vec3: "put3", wp.vec4: "put4"}


@cache
def build_path(features: RenderFeatures) -> PathRecord:
    """The path that a kernel of these features has."""
    needed = [row for row in PATH if row.needs(features)]
    kept = [row for row in needed if row.is_kept(features)]
    fields = {row.name: row.dtype for row in needed if "." not in row.name} | NESTED
    struct = make_struct("Path", fields)
    at, row_count = places((row.name, row.dtype) for row in kept)
    loads, stores = ["path = Path()"], []
    for row in kept:
        value = f"{GETTERS[row.dtype]}(lanes, {at[row.name]}, i)"
        loads.append(f"path.{row.name} = {f'wp.uint32({value})' if row.dtype is wp.uint32 else value}")
        value = f"wp.int32(path.{row.name})" if row.dtype is wp.uint32 else f"path.{row.name}"
        stores.append(f"{PUTTERS[row.dtype]}(lanes, {at[row.name]}, i, {value})")
    births = [f"path.{row.name} = {literal(row.initial, row.dtype)}" for row in needed if row.initial is not None]
    of_getters = {"get": get, "get_int": get_int, "get3": get3, "get4": get4}
    of_putters = {"put": put, "put_int": put_int, "put3": put3, "put4": put4}
    lanes = "lanes: wp.array(dtype=float), i: int"
    return PathRecord(
        struct,
        make_function("newborn() -> Path", ["path = Path()", *births, "return path"], {"Path": struct}),
        make_function(f"load({lanes}) -> Path", [*loads, "return path"], {"Path": struct, **of_getters}),
        make_function(f"store({lanes}, path: Path)", stores, {"Path": struct, **of_putters}),
        row_count * int(LANES),
    )

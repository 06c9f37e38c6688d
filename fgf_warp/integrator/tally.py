"""A pixel's sums over its samples, in float64 and in the order of the samples, made from the table of planes.

So an image does not depend on how its samples are cut into steps, nor on what else is rendered with it. The film has an
array of each plane, and a pixel's tally a field, while samples are added to the pixel.
"""

from functools import cache
from typing import Any, NamedTuple

import warp as wp

from fgf_warp.device.numerics import INFINITE, is_finite
from fgf_warp.features import RenderFeatures
from fgf_warp.integrator.path import PATH, build_path
from fgf_warp.integrator.planes import PLANES, RULES, Plane
from fgf_warp.integrator.rows import LANES, make_function, make_struct, places

OF_TALLY = {wp.float32: float, wp.int32: int}
"""Types of a tally's fields where they are not those of the film."""


class TallyRecord(NamedTuple):
    """The sums of a kernel's pixels.

    Args:
        planes: those that the kernel has.
        film: the struct `Film`, an array for each plane, with an entry per pixel of each image, image after image.
        struct: `Tally`, the film's entry for one pixel.
        read: the function (film, place) -> Tally.
        write: the function (film, place, tally).
        add: the function (tally, path, is_complete) -> Tally, with the path in it where it is complete; branch-free.
        load: the function (sums, i) -> Tally, of lane i's pixel.
        store: the function (sums, i, tally).
        sum_count: length of the float64 array `sums`.
    """

    planes: tuple[Plane, ...]
    film: Any
    struct: Any
    read: Any
    write: Any
    add: Any
    load: Any
    store: Any
    sum_count: int


@wp.func(inline=True)
def add_where(condition: bool, total: wp.vec3d, value: wp.vec3) -> wp.vec3d:
    """total + value, or total."""
    return wp.vec3d(
        total[0] + wp.float64(wp.where(condition, value[0], 0.0)),
        total[1] + wp.float64(wp.where(condition, value[1], 0.0)),
        total[2] + wp.float64(wp.where(condition, value[2], 0.0)),
    )


@wp.func(inline=True)
def square(v: wp.vec3d) -> wp.vec3d:
    """Of each component."""
    return wp.vec3d(v[0] * v[0], v[1] * v[1], v[2] * v[2])


@wp.func(inline=True)
def get3d(sums: wp.array(dtype=wp.float64), row: int, i: int) -> wp.vec3d:
    """A vector of lane i's tally."""
    at = row * LANES + i
    return wp.vec3d(sums[at], sums[at + LANES], sums[at + 2 * LANES])


@wp.func(inline=True)
def put3d(sums: wp.array(dtype=wp.float64), row: int, i: int, value: wp.vec3d):
    """Sets a vector of lane i's tally."""
    at = row * LANES + i
    sums[at] = value[0]
    sums[at + LANES] = value[1]
    sums[at + 2 * LANES] = value[2]


def planes_of(features: RenderFeatures) -> tuple[Plane, ...]:
    """The planes that a kernel of these features sums."""
    return tuple(plane for plane in PLANES if plane.is_needed(features.aovs))


@cache
def build_tally(features: RenderFeatures) -> TallyRecord:
    """The tally that a kernel of these features has."""
    planes = planes_of(features)
    path = build_path(features).struct
    film = make_struct("Film", {plane.name: wp.array(dtype=plane.dtype) for plane in planes})
    tally = make_struct("Tally", {plane.name: OF_TALLY.get(plane.dtype, plane.dtype) for plane in planes})
    at, row_count = places((plane.name, plane.dtype) for plane in planes)
    loads, stores = [], []
    for plane in planes:
        row = at[plane.name]
        element = f"sums[{row} * LANES + i]"
        if plane.dtype is wp.vec3d:
            loads.append(f"tally.{plane.name} = get3d(sums, {row}, i)")
            stores.append(f"put3d(sums, {row}, i, tally.{plane.name})")
        elif plane.dtype is wp.float64:
            loads.append(f"tally.{plane.name} = {element}")
            stores.append(f"{element} = tally.{plane.name}")
        else:
            loads.append(f"tally.{plane.name} = {OF_TALLY[plane.dtype].__name__}({element})")
            stores.append(f"{element} = wp.float64(tally.{plane.name})")
    structs = {"Film": film, "Tally": tally}
    reads = [f"tally.{plane.name} = film.{plane.name}[place]" for plane in planes]
    writes = [f"film.{plane.name}[place] = tally.{plane.name}" for plane in planes]
    lane, blank, whole = "sums: wp.array(dtype=wp.float64), i: int", "tally = Tally()", "return tally"
    return TallyRecord(
        planes,
        film,
        tally,
        make_function("read(film: Film, place: int) -> Tally", [blank, *reads, whole], structs, inline=False),
        make_function("write(film: Film, place: int, tally: Tally)", writes, structs, inline=False),
        make_function(
            "add(before: Tally, path: Path, is_complete: bool) -> Tally",
            ["tally = before", "is_valid = is_complete and is_finite(path.radiance)", *_additions(features), whole],
            {
                "Tally": tally,
                "Path": path,
                "add_where": add_where,
                "square": square,
                "is_finite": is_finite,
                "INFINITE": INFINITE,
            },
        ),
        make_function(f"load({lane}) -> Tally", [blank, *loads, whole], {"Tally": tally, "get3d": get3d}),
        make_function(f"store({lane}, tally: Tally)", stores, {"Tally": tally, "put3d": put3d}),
        row_count * int(LANES),
    )


def _additions(features: RenderFeatures) -> list[str]:
    """Lines that add a path to a tally; what a path does not have adds nothing."""
    absent = {f"path.{row.name}" for row in PATH if not row.needs(features)}
    return [
        f"tally.{plane.name} = {RULES[plane.rule].format(name=plane.name, value=plane.source)}"
        for plane in planes_of(features)
        if plane.source not in absent
    ]

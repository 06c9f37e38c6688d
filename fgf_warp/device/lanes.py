"""Paths as structs, and a pool of them as rows of a scratch array, one row of `LANES` floats per number.

The rows lie in one array that the kernel makes itself from a pointer: its stride is then known when it is compiled,
and loops over lanes become vector code. (The stride of an array argument is known at run time only, and an index that
might be negative is wrapped; each alone keeps such a loop scalar.) Loading and storing a whole path costs nothing:
what a stage does not use is not loaded, and what it does not change is not stored.
"""

from typing import Any

import warp as wp

from fgf_warp.device.film import Tally
from fgf_warp.device.geometry import Hit, Start
from fgf_warp.device.phase import Phase

LANES = wp.constant(128)

FIRST_AOVS = frozenset({"depth", "transmittance", "albedo", "optical_depth"})
"""Planes of what a path meets first."""
SUMMED_AOVS = ("collisions", "path_length", "normal", "motion", "optical_depth")
"""Planes of vectors that a path carries and a pixel sums, each by itself."""
SPLIT_AOVS = frozenset({"direct", "indirect"})
PRIM_AOVS = frozenset({"prim_id", "instance_id", "motion"})
"""Planes that tell what is seen first."""

NOT_SEEN = wp.constant(-1)
FIRST_CONTAINER = wp.constant(-2)


@wp.struct
class Path:
    """A path, at an event or between two."""

    pixel: int
    """Of the image; -1 in a lane that has none."""
    row: int
    column: int
    sample: int
    """Its number less `end_sample`, so that the last one of the pixel is -1; in a lane that is done for good 1."""
    end_sample: int
    """After the last one of the pixel, for now."""
    shift_x: int
    shift_y: int
    """Of the pixel's lattice."""
    turn: int
    """The sample's number with its bits reversed: the address of random numbers."""
    alive: int
    origin: wp.vec3
    direction: wp.vec3
    throughput: wp.vec3
    radiance: wp.vec3
    alpha: float
    truncated: int
    bounce: int
    """Events so far, crossings included: the address of random numbers."""
    depth: int
    """Scattering events so far."""
    start: Start
    segment: float
    """Distance on the ray at which the path entered the medium that it is in."""
    keeps: int
    """1: what was crossed did not change the medium, and the flight goes on."""
    crossings: int
    """Boundaries crossed since the last scattering event."""
    from_medium: int
    """1: the segment began at a medium vertex, and its flight remembers the last one."""
    pdf_direction: float
    """pdf_solid_angle with which the path last scattered, at the ray's origin."""
    links: wp.uint32
    """Of the shape where the path last scattered: which linked lights shine there."""
    rates: wp.vec3
    """Per channel, at which the path is frozen in its medium, or NOT_FROZEN; equal unless the scene is chromatic."""
    channel: int
    """Whose law the flights are sampled from, in a chromatic scene."""
    length: float
    """Of the flight, from where its segment began: `flight` less `segment`, but not rounded; in a chromatic scene."""
    channel_pdfs: wp.vec3
    """Density of the path's flights under each channel, over that under `channel`."""
    first_depth: float
    first_transmittance: wp.vec3
    first_albedo: wp.vec3
    has_met_medium: int
    collisions: wp.vec3
    """In media so far, each weighted by the throughput before it."""
    path_length: wp.vec3
    """In media so far, weighted alike."""
    first_normal: wp.vec3
    first_motion: wp.vec3
    first_optical_depth: wp.vec3
    seen: float
    """Distance of the surface that is met first, or of scattering in a medium; INFINITE before."""
    seen_item: int
    """That surface, or FIRST_CONTAINER less the container; NOT_SEEN before."""
    seen_at: wp.vec3
    container: int
    """Whose medium it scatters in, where media differ."""
    body: int
    """The container that it came into its medium by, whose `rates` it has; -1: to be found when it flies."""
    direct: wp.vec3
    """The part of `radiance` that came before a second scattering event."""

    xi: wp.vec4
    """Of this event: flight, roulette, and two for the new direction."""
    medium: int
    """That the path flies in, or -1."""
    flight: float
    """Distance to the next scattering event, were the medium unbounded."""
    hit: Hit
    t_in: float
    t_out: float
    """Distances between which the ray is in the lone solid."""
    met: wp.vec3
    """Radiance from what is met, or from distant lights beyond, times its mis_weight."""
    albedo: wp.vec3
    """Of the surface that is met, or where media differ, of the medium."""
    phase: Phase
    """Of the medium, where media differ."""
    passes: int
    """1: the surface that is met lets it pass, straight on."""
    transmits: int
    """1: it is scattered to the other side of the surface that it met."""
    incoming: wp.vec3
    """Throughput before the last surface."""
    reflectance: wp.vec3
    """Colour of the surface that is met."""
    squeeze: float
    """Square of the index of refraction where it is, over that at the camera: throughput is of L / n^2."""
    scatters: int
    """SURFACE or BOUNDARY (in a medium) where this event scatters the path on, else MISS."""
    wi: wp.vec3
    """The new direction."""
    to_light: wp.vec3
    """Direction of the connection."""
    light_distance: float
    light_share: wp.vec3
    """Radiance that the connection would bring through empty space; 0 where it is blocked."""


def slots(features: Any) -> dict[str, int]:
    """First row of each number that paths carry between the stages of a scene of these features."""
    sizes = {"pixel": 1, "row": 1, "column": 1, "sample": 1, "end_sample": 1, "turn": 1, "alive": 1}
    sizes |= {"origin": 3, "direction": 3, "throughput": 3, "radiance": 3, "alpha": 1, "truncated": 1}
    sizes |= {"bounce": 1, "depth": 1, "xi": 4, "flight": 1}
    sizes |= {"hit_t": 1, "hit_kind": 1, "hit_item": 1}
    if features.sampler == "lattice":
        sizes |= {"shift_x": 1, "shift_y": 1}
    if features.media:
        sizes |= {"inside": 1}
    if features.motion:
        sizes |= {"time": 1}
    if features.lone_solid:
        sizes |= {"t_in": 1, "t_out": 1}
    if features.crossings:
        sizes |= {"t_min": 1, "crossings": 1, "medium": 1}
    if features.media and features.lone_law != "exponential":
        sizes |= {"from_medium": 1}
    if features.meshes:
        sizes |= {"crossed": 1, "slack": 1}
    if features.faces:
        sizes |= {"face": 1, "u": 1, "v": 1}
    if features.passes:
        sizes |= {"passed": 1}
    if features.lone_law == "":
        sizes |= {"segment": 1, "keeps": 1} | dict.fromkeys(features.phase_parameters, 1)
    if features.surfaces or features.connections:
        sizes |= {"met": 3}
    if features.surfaces or features.lone_law == "":
        sizes |= {"albedo": 3}
    if features.surfaces:
        sizes |= {"hit_normal": 3}
    if features.connections:
        sizes |= {"pdf_direction": 1, "scatters": 1, "wi": 3}
    if features.connects_in_lanes:
        sizes |= {"to_light": 3, "light_distance": 1, "light_share": 3}
    if features.links:
        sizes |= {"links": 1}
    if features.shading:
        sizes |= {"wi": 3, "pdf_direction": 1}
        if features.connections:
            sizes |= {"incoming": 3}
        if "albedo" in features.aovs:
            sizes |= {"reflectance": 3}
    if features.passes:
        sizes |= {"passes": 1}
    if features.refracts:
        sizes |= {"transmits": 1, "squeeze": 1}
    if features.chromatic:
        sizes |= {"channel": 1, "length": 1, "channel_pdfs": 3}
    if features.contacts:
        sizes |= {"entered": 1}
    if features.frozen:
        sizes |= {"rates": 3 if features.chromatic else 1}
        if features.lone_law == "":
            sizes |= {"body": 1}
    if features.aovs & FIRST_AOVS:
        sizes |= {"first_depth": 1, "first_transmittance": 3, "first_albedo": 3, "has_met_medium": 1}
    if features.aovs & PRIM_AOVS and features.media and features.lone_law == "":
        sizes |= {"container": 1}
    if "motion" in features.aovs:
        sizes |= {"seen_at": 3}
    return rows_of(sizes | own_sizes(features))


def own_sizes(features: Any) -> dict[str, int]:
    """Numbers that both paths and tallies have for the planes that share none."""
    sizes = {name: 3 for name in SUMMED_AOVS if name in features.aovs}
    if features.aovs & SPLIT_AOVS:
        sizes |= {"direct": 3}
    if features.aovs & PRIM_AOVS:
        sizes |= {"seen": 1, "seen_item": 1}
    return sizes


def tally_slots(features: Any) -> dict[str, int]:
    """First row, of float64, of each number that a pixel's tally has in a scene of these features."""
    sizes = {"radiance": 3, "radiance_sq": 3, "alpha": 1, "invalid": 1, "truncated": 1}
    if features.aovs & FIRST_AOVS:
        sizes |= {"depth": 1, "transmittance": 3, "albedo": 3}
    if "scatterings" in features.aovs:
        sizes |= {"scatterings": 1}
    return rows_of(sizes | own_sizes(features))


def rows_of(sizes: dict[str, int]) -> dict[str, int]:
    """First row of each number, one after the other, and under "" the number of rows."""
    rows, place = {}, 0
    for name, size in sizes.items():
        rows[name] = place
        place += size
    return rows | {"": place}


def lane_floats(features: Any) -> int:
    """Floats of the paths' rows."""
    return slots(features)[""] * int(LANES)


def tally_floats(features: Any) -> int:
    """Numbers, of float64, of the tallies' rows."""
    return tally_slots(features)[""] * int(LANES)


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


def build_tallies(features: Any) -> tuple[Any, Any]:
    """Functions on lane i: load the tally of its pixel, and store it."""
    at = tally_slots(features)

    @wp.func(inline=True)
    def load_tally(sums: wp.array(dtype=wp.float64), i: int) -> Tally:
        tally = Tally()
        tally.radiance = get3d(sums, wp.static(at["radiance"]), i)
        tally.radiance_sq = get3d(sums, wp.static(at["radiance_sq"]), i)
        tally.alpha = sums[wp.static(at["alpha"]) * LANES + i]
        tally.invalid = int(sums[wp.static(at["invalid"]) * LANES + i])
        tally.truncated = int(sums[wp.static(at["truncated"]) * LANES + i])
        if wp.static("depth" in at):
            tally.depth = float(sums[wp.static(at["depth"]) * LANES + i])
            tally.transmittance = get3d(sums, wp.static(at["transmittance"]), i)
            tally.albedo = get3d(sums, wp.static(at["albedo"]), i)
        if wp.static("collisions" in at):
            tally.collisions = get3d(sums, wp.static(at["collisions"]), i)
        if wp.static("path_length" in at):
            tally.path_length = get3d(sums, wp.static(at["path_length"]), i)
        if wp.static("normal" in at):
            tally.normal = get3d(sums, wp.static(at["normal"]), i)
        if wp.static("motion" in at):
            tally.motion = get3d(sums, wp.static(at["motion"]), i)
        if wp.static("optical_depth" in at):
            tally.optical_depth = get3d(sums, wp.static(at["optical_depth"]), i)
        if wp.static("direct" in at):
            tally.direct = get3d(sums, wp.static(at["direct"]), i)
        if wp.static("scatterings" in at):
            tally.scatterings = sums[wp.static(at["scatterings"]) * LANES + i]
        if wp.static("seen" in at):
            tally.seen = float(sums[wp.static(at["seen"]) * LANES + i])
            tally.seen_item = int(sums[wp.static(at["seen_item"]) * LANES + i])
        return tally

    @wp.func(inline=True)
    def store_tally(sums: wp.array(dtype=wp.float64), i: int, tally: Tally):
        put3d(sums, wp.static(at["radiance"]), i, tally.radiance)
        put3d(sums, wp.static(at["radiance_sq"]), i, tally.radiance_sq)
        sums[wp.static(at["alpha"]) * LANES + i] = tally.alpha
        sums[wp.static(at["invalid"]) * LANES + i] = wp.float64(tally.invalid)
        sums[wp.static(at["truncated"]) * LANES + i] = wp.float64(tally.truncated)
        if wp.static("depth" in at):
            sums[wp.static(at["depth"]) * LANES + i] = wp.float64(tally.depth)
            put3d(sums, wp.static(at["transmittance"]), i, tally.transmittance)
            put3d(sums, wp.static(at["albedo"]), i, tally.albedo)
        if wp.static("collisions" in at):
            put3d(sums, wp.static(at["collisions"]), i, tally.collisions)
        if wp.static("path_length" in at):
            put3d(sums, wp.static(at["path_length"]), i, tally.path_length)
        if wp.static("normal" in at):
            put3d(sums, wp.static(at["normal"]), i, tally.normal)
        if wp.static("motion" in at):
            put3d(sums, wp.static(at["motion"]), i, tally.motion)
        if wp.static("optical_depth" in at):
            put3d(sums, wp.static(at["optical_depth"]), i, tally.optical_depth)
        if wp.static("direct" in at):
            put3d(sums, wp.static(at["direct"]), i, tally.direct)
        if wp.static("scatterings" in at):
            sums[wp.static(at["scatterings"]) * LANES + i] = tally.scatterings
        if wp.static("seen" in at):
            sums[wp.static(at["seen"]) * LANES + i] = wp.float64(tally.seen)
            sums[wp.static(at["seen_item"]) * LANES + i] = wp.float64(tally.seen_item)

    return load_tally, store_tally


def build_lanes(features: Any) -> tuple[Any, Any]:
    """Functions on lane i: load its path, and store it."""
    at = slots(features)

    @wp.func(inline=True)
    def load(lanes: wp.array(dtype=float), i: int) -> Path:
        path = Path()
        path.pixel = get_int(lanes, wp.static(at["pixel"]), i)
        path.row = get_int(lanes, wp.static(at["row"]), i)
        path.column = get_int(lanes, wp.static(at["column"]), i)
        path.sample = get_int(lanes, wp.static(at["sample"]), i)
        path.end_sample = get_int(lanes, wp.static(at["end_sample"]), i)
        path.turn = get_int(lanes, wp.static(at["turn"]), i)
        path.alive = get_int(lanes, wp.static(at["alive"]), i)
        path.origin = get3(lanes, wp.static(at["origin"]), i)
        path.direction = get3(lanes, wp.static(at["direction"]), i)
        path.throughput = get3(lanes, wp.static(at["throughput"]), i)
        path.radiance = get3(lanes, wp.static(at["radiance"]), i)
        path.alpha = get(lanes, wp.static(at["alpha"]), i)
        path.truncated = get_int(lanes, wp.static(at["truncated"]), i)
        path.bounce = get_int(lanes, wp.static(at["bounce"]), i)
        path.depth = get_int(lanes, wp.static(at["depth"]), i)
        xi = wp.static(at["xi"])
        path.xi = wp.vec4(get(lanes, xi, i), get(lanes, xi + 1, i), get(lanes, xi + 2, i), get(lanes, xi + 3, i))
        path.flight = get(lanes, wp.static(at["flight"]), i)
        path.hit.t = get(lanes, wp.static(at["hit_t"]), i)
        path.hit.kind = get_int(lanes, wp.static(at["hit_kind"]), i)
        path.hit.item = get_int(lanes, wp.static(at["hit_item"]), i)
        path.medium = -1
        if wp.static("shift_x" in at):
            path.shift_x = get_int(lanes, wp.static(at["shift_x"]), i)
            path.shift_y = get_int(lanes, wp.static(at["shift_y"]), i)
        if wp.static("inside" in at):
            path.start.inside = wp.uint32(get_int(lanes, wp.static(at["inside"]), i))
        if wp.static("time" in at):
            path.start.time = get(lanes, wp.static(at["time"]), i)
        if wp.static("t_in" in at):
            path.t_in = get(lanes, wp.static(at["t_in"]), i)
            path.t_out = get(lanes, wp.static(at["t_out"]), i)
        if wp.static("t_min" in at):
            path.start.t_min = get(lanes, wp.static(at["t_min"]), i)
            path.segment = path.start.t_min
            path.crossings = get_int(lanes, wp.static(at["crossings"]), i)
            path.medium = get_int(lanes, wp.static(at["medium"]), i)
        if wp.static("from_medium" in at):
            path.from_medium = get_int(lanes, wp.static(at["from_medium"]), i)
        if wp.static("crossed" in at):
            path.start.crossed = get_int(lanes, wp.static(at["crossed"]), i)
            path.start.slack = get(lanes, wp.static(at["slack"]), i)
        if wp.static("face" in at):
            path.hit.face = get_int(lanes, wp.static(at["face"]), i)
            path.hit.u = get(lanes, wp.static(at["u"]), i)
            path.hit.v = get(lanes, wp.static(at["v"]), i)
        if wp.static("passed" in at):
            path.start.passed = get(lanes, wp.static(at["passed"]), i)
        if wp.static("segment" in at):
            path.segment = get(lanes, wp.static(at["segment"]), i)
            path.keeps = get_int(lanes, wp.static(at["keeps"]), i)
        if wp.static("asymmetry" in at):
            path.phase.asymmetry = get(lanes, wp.static(at["asymmetry"]), i)
        if wp.static("back_weight" in at):
            path.phase.back_asymmetry = get(lanes, wp.static(at["back_asymmetry"]), i)
            path.phase.back_weight = get(lanes, wp.static(at["back_weight"]), i)
        if wp.static("draine_alpha" in at):
            path.phase.draine_alpha = get(lanes, wp.static(at["draine_alpha"]), i)
        if wp.static("met" in at):
            path.met = get3(lanes, wp.static(at["met"]), i)
        if wp.static("albedo" in at):
            path.albedo = get3(lanes, wp.static(at["albedo"]), i)
        if wp.static("hit_normal" in at):
            path.hit.normal = get3(lanes, wp.static(at["hit_normal"]), i)
        if wp.static("pdf_direction" in at):
            path.pdf_direction = get(lanes, wp.static(at["pdf_direction"]), i)
            path.wi = get3(lanes, wp.static(at["wi"]), i)
        if wp.static("scatters" in at):
            path.scatters = get_int(lanes, wp.static(at["scatters"]), i)
        if wp.static("incoming" in at):
            path.incoming = get3(lanes, wp.static(at["incoming"]), i)
        if wp.static("reflectance" in at):
            path.reflectance = get3(lanes, wp.static(at["reflectance"]), i)
        if wp.static("passes" in at):
            path.passes = get_int(lanes, wp.static(at["passes"]), i)
        if wp.static("transmits" in at):
            path.transmits = get_int(lanes, wp.static(at["transmits"]), i)
            path.squeeze = get(lanes, wp.static(at["squeeze"]), i)
        if wp.static("to_light" in at):
            path.to_light = get3(lanes, wp.static(at["to_light"]), i)
            path.light_distance = get(lanes, wp.static(at["light_distance"]), i)
            path.light_share = get3(lanes, wp.static(at["light_share"]), i)
        if wp.static("links" in at):
            path.links = wp.uint32(get_int(lanes, wp.static(at["links"]), i))
        if wp.static("channel" in at):
            path.channel = get_int(lanes, wp.static(at["channel"]), i)
            path.length = get(lanes, wp.static(at["length"]), i)
            path.channel_pdfs = get3(lanes, wp.static(at["channel_pdfs"]), i)
        if wp.static("rates" in at):
            if wp.static(features.chromatic):
                path.rates = get3(lanes, wp.static(at["rates"]), i)
            else:
                path.rates = wp.vec3(get(lanes, wp.static(at["rates"]), i))
        if wp.static("entered" in at):
            path.start.entered = wp.uint32(get_int(lanes, wp.static(at["entered"]), i))
        if wp.static("body" in at):
            path.body = get_int(lanes, wp.static(at["body"]), i)
        if wp.static("first_depth" in at):
            path.first_depth = get(lanes, wp.static(at["first_depth"]), i)
            path.first_transmittance = get3(lanes, wp.static(at["first_transmittance"]), i)
            path.first_albedo = get3(lanes, wp.static(at["first_albedo"]), i)
            path.has_met_medium = get_int(lanes, wp.static(at["has_met_medium"]), i)
        if wp.static("collisions" in at):
            path.collisions = get3(lanes, wp.static(at["collisions"]), i)
        if wp.static("path_length" in at):
            path.path_length = get3(lanes, wp.static(at["path_length"]), i)
        if wp.static("normal" in at):
            path.first_normal = get3(lanes, wp.static(at["normal"]), i)
        if wp.static("motion" in at):
            path.first_motion = get3(lanes, wp.static(at["motion"]), i)
        if wp.static("optical_depth" in at):
            path.first_optical_depth = get3(lanes, wp.static(at["optical_depth"]), i)
        if wp.static("direct" in at):
            path.direct = get3(lanes, wp.static(at["direct"]), i)
        if wp.static("seen" in at):
            path.seen = get(lanes, wp.static(at["seen"]), i)
            path.seen_item = get_int(lanes, wp.static(at["seen_item"]), i)
        if wp.static("seen_at" in at):
            path.seen_at = get3(lanes, wp.static(at["seen_at"]), i)
        if wp.static("container" in at):
            path.container = get_int(lanes, wp.static(at["container"]), i)
        return path

    @wp.func(inline=True)
    def store(lanes: wp.array(dtype=float), i: int, path: Path):
        put_int(lanes, wp.static(at["pixel"]), i, path.pixel)
        put_int(lanes, wp.static(at["row"]), i, path.row)
        put_int(lanes, wp.static(at["column"]), i, path.column)
        put_int(lanes, wp.static(at["sample"]), i, path.sample)
        put_int(lanes, wp.static(at["end_sample"]), i, path.end_sample)
        put_int(lanes, wp.static(at["turn"]), i, path.turn)
        put_int(lanes, wp.static(at["alive"]), i, path.alive)
        put3(lanes, wp.static(at["origin"]), i, path.origin)
        put3(lanes, wp.static(at["direction"]), i, path.direction)
        put3(lanes, wp.static(at["throughput"]), i, path.throughput)
        put3(lanes, wp.static(at["radiance"]), i, path.radiance)
        put(lanes, wp.static(at["alpha"]), i, path.alpha)
        put_int(lanes, wp.static(at["truncated"]), i, path.truncated)
        put_int(lanes, wp.static(at["bounce"]), i, path.bounce)
        put_int(lanes, wp.static(at["depth"]), i, path.depth)
        xi = wp.static(at["xi"])
        put(lanes, xi, i, path.xi[0])
        put(lanes, xi + 1, i, path.xi[1])
        put(lanes, xi + 2, i, path.xi[2])
        put(lanes, xi + 3, i, path.xi[3])
        put(lanes, wp.static(at["flight"]), i, path.flight)
        put(lanes, wp.static(at["hit_t"]), i, path.hit.t)
        put_int(lanes, wp.static(at["hit_kind"]), i, path.hit.kind)
        put_int(lanes, wp.static(at["hit_item"]), i, path.hit.item)
        if wp.static("shift_x" in at):
            put_int(lanes, wp.static(at["shift_x"]), i, path.shift_x)
            put_int(lanes, wp.static(at["shift_y"]), i, path.shift_y)
        if wp.static("inside" in at):
            put_int(lanes, wp.static(at["inside"]), i, wp.int32(path.start.inside))
        if wp.static("time" in at):
            put(lanes, wp.static(at["time"]), i, path.start.time)
        if wp.static("t_in" in at):
            put(lanes, wp.static(at["t_in"]), i, path.t_in)
            put(lanes, wp.static(at["t_out"]), i, path.t_out)
        if wp.static("t_min" in at):
            put(lanes, wp.static(at["t_min"]), i, path.start.t_min)
            put_int(lanes, wp.static(at["crossings"]), i, path.crossings)
            put_int(lanes, wp.static(at["medium"]), i, path.medium)
        if wp.static("from_medium" in at):
            put_int(lanes, wp.static(at["from_medium"]), i, path.from_medium)
        if wp.static("crossed" in at):
            put_int(lanes, wp.static(at["crossed"]), i, path.start.crossed)
            put(lanes, wp.static(at["slack"]), i, path.start.slack)
        if wp.static("face" in at):
            put_int(lanes, wp.static(at["face"]), i, path.hit.face)
            put(lanes, wp.static(at["u"]), i, path.hit.u)
            put(lanes, wp.static(at["v"]), i, path.hit.v)
        if wp.static("passed" in at):
            put(lanes, wp.static(at["passed"]), i, path.start.passed)
        if wp.static("segment" in at):
            put(lanes, wp.static(at["segment"]), i, path.segment)
            put_int(lanes, wp.static(at["keeps"]), i, path.keeps)
        if wp.static("asymmetry" in at):
            put(lanes, wp.static(at["asymmetry"]), i, path.phase.asymmetry)
        if wp.static("back_weight" in at):
            put(lanes, wp.static(at["back_asymmetry"]), i, path.phase.back_asymmetry)
            put(lanes, wp.static(at["back_weight"]), i, path.phase.back_weight)
        if wp.static("draine_alpha" in at):
            put(lanes, wp.static(at["draine_alpha"]), i, path.phase.draine_alpha)
        if wp.static("met" in at):
            put3(lanes, wp.static(at["met"]), i, path.met)
        if wp.static("albedo" in at):
            put3(lanes, wp.static(at["albedo"]), i, path.albedo)
        if wp.static("hit_normal" in at):
            put3(lanes, wp.static(at["hit_normal"]), i, path.hit.normal)
        if wp.static("pdf_direction" in at):
            put(lanes, wp.static(at["pdf_direction"]), i, path.pdf_direction)
            put3(lanes, wp.static(at["wi"]), i, path.wi)
        if wp.static("scatters" in at):
            put_int(lanes, wp.static(at["scatters"]), i, path.scatters)
        if wp.static("incoming" in at):
            put3(lanes, wp.static(at["incoming"]), i, path.incoming)
        if wp.static("reflectance" in at):
            put3(lanes, wp.static(at["reflectance"]), i, path.reflectance)
        if wp.static("passes" in at):
            put_int(lanes, wp.static(at["passes"]), i, path.passes)
        if wp.static("transmits" in at):
            put_int(lanes, wp.static(at["transmits"]), i, path.transmits)
            put(lanes, wp.static(at["squeeze"]), i, path.squeeze)
        if wp.static("to_light" in at):
            put3(lanes, wp.static(at["to_light"]), i, path.to_light)
            put(lanes, wp.static(at["light_distance"]), i, path.light_distance)
            put3(lanes, wp.static(at["light_share"]), i, path.light_share)
        if wp.static("links" in at):
            put_int(lanes, wp.static(at["links"]), i, wp.int32(path.links))
        if wp.static("channel" in at):
            put_int(lanes, wp.static(at["channel"]), i, path.channel)
            put(lanes, wp.static(at["length"]), i, path.length)
            put3(lanes, wp.static(at["channel_pdfs"]), i, path.channel_pdfs)
        if wp.static("rates" in at):
            if wp.static(features.chromatic):
                put3(lanes, wp.static(at["rates"]), i, path.rates)
            else:
                put(lanes, wp.static(at["rates"]), i, path.rates[0])
        if wp.static("entered" in at):
            put_int(lanes, wp.static(at["entered"]), i, wp.int32(path.start.entered))
        if wp.static("body" in at):
            put_int(lanes, wp.static(at["body"]), i, path.body)
        if wp.static("first_depth" in at):
            put(lanes, wp.static(at["first_depth"]), i, path.first_depth)
            put3(lanes, wp.static(at["first_transmittance"]), i, path.first_transmittance)
            put3(lanes, wp.static(at["first_albedo"]), i, path.first_albedo)
            put_int(lanes, wp.static(at["has_met_medium"]), i, path.has_met_medium)
        if wp.static("collisions" in at):
            put3(lanes, wp.static(at["collisions"]), i, path.collisions)
        if wp.static("path_length" in at):
            put3(lanes, wp.static(at["path_length"]), i, path.path_length)
        if wp.static("normal" in at):
            put3(lanes, wp.static(at["normal"]), i, path.first_normal)
        if wp.static("motion" in at):
            put3(lanes, wp.static(at["motion"]), i, path.first_motion)
        if wp.static("optical_depth" in at):
            put3(lanes, wp.static(at["optical_depth"]), i, path.first_optical_depth)
        if wp.static("direct" in at):
            put3(lanes, wp.static(at["direct"]), i, path.direct)
        if wp.static("seen" in at):
            put(lanes, wp.static(at["seen"]), i, path.seen)
            put_int(lanes, wp.static(at["seen_item"]), i, path.seen_item)
        if wp.static("seen_at" in at):
            put3(lanes, wp.static(at["seen_at"]), i, path.seen_at)
        if wp.static("container" in at):
            put_int(lanes, wp.static(at["container"]), i, path.container)

    return load, store

"""What a light is on the device, how one is chosen, and how a place is drawn from cumulative shares."""

import warp as wp

from fgf_warp.device.textures import Images

DISTANT = wp.constant(0)
RECT = wp.constant(1)
DISK = wp.constant(2)
SPHERE_LIGHT = wp.constant(3)
DOME = wp.constant(4)
CYLINDER_LIGHT = wp.constant(5)
MESH_LIGHT = wp.constant(6)


@wp.struct
class Light:
    """One light; which fields are used depends on the kind."""

    kind: int
    """One of the constants above."""
    first_chance: float
    last_chance: float
    """It is connected to where a uniform number falls between these."""
    radiance: wp.vec3
    """Linear Rec.709; of a distant light without extent its irradiance."""
    center: wp.vec3
    """Of a distant light: the unit vector towards it."""
    half_u: wp.vec3
    """Along an image's s; of a cylinder: from its center to the middle of one end."""
    half_v: wp.vec3
    """Along an image's t, upwards."""
    dual_u: wp.vec3
    dual_v: wp.vec3
    """Dual to the half vectors in the light's plane: the coordinate along half_u is dot(dual_u, p - center)."""
    normal: wp.vec3
    """The emitting side of a rect or disk; of a cylinder its unit axis."""
    area: float
    """Of a light with a shape [stage unit^2]."""
    radius: float
    """Of a sphere or a cylinder [stage unit]."""
    cone: float
    """1 - cos of a distant light's half angle; 0 is a delta light."""
    to_light: wp.mat33
    """Of a dome: from the world to its own axes, of which y is the pole."""
    image: int
    """That multiplies the radiance, or -1."""
    columns: int
    rows: int
    """Of an image; of a mesh, its triangles in one row."""
    first_place: int
    """Of its rows in `LightTables.places`."""
    first_corner: int
    """Of a mesh: in `LightTables.corners`."""
    is_shaped: int
    axis: wp.vec3
    """Of the shaping."""
    fade_angle: float
    cone_angle: float
    """Angles with the axis [rad] at which the light begins to fade, and beyond which there is none."""
    focus: float
    focus_tint: wp.vec3
    """Of UsdLux.ShapingAPI."""
    link: wp.uint32
    """The bit of the shapes that it shines on; 0: all."""
    casters: wp.uint32
    """The bit of the shapes that cast shadows in its light; 0: all."""
    casting_containers: wp.uint32
    """Bits of the containers that do."""


@wp.struct
class LightTables:
    """What lights look up."""

    places: wp.array(dtype=float)
    """Per image: the cumulative shares of its rows, from 0 to 1, then for each row those of its columns; per mesh those
    of its triangles."""
    corners: wp.array(dtype=wp.vec3)
    """Per mesh: three of each triangle, counter-clockwise seen from the side that emits."""
    images: Images


@wp.struct
class LightSample:
    """A direction towards a light."""

    direction: wp.vec3
    """Unit vector."""
    distance: float
    """To the light's point [stage unit]; `INFINITE` where the light is beyond the scene."""
    radiance: wp.vec3
    """What the light sends from there."""
    pdf_solid_angle: float
    """[1/sr]; 0 where the light cannot be reached; 1 for a delta light."""
    only_connected: int
    """1 where no scattered ray finds the light, as of a delta light."""


@wp.func(inline=True)
def chance(light: Light) -> float:
    """Probability, in [0, 1], with which it is the light that a path connects to."""
    return light.last_chance - light.first_chance


@wp.func
def choose_light(lights: wp.array(dtype=Light), xi: float) -> int:
    """Index of the light whose chances a uniform xi falls in; there is at least one light."""
    low = int(0)
    high = int(lights.shape[0] - 1)
    while low < high:
        middle = (low + high) // 2
        if lights[middle].last_chance <= xi:
            low = middle + 1
        else:
            high = middle
    return low


@wp.struct
class Place:
    """One of several places, drawn in proportion to its share."""

    item: int
    within: float
    """How far the uniform number is between the place's ends, in [0, 1]."""
    share: float


@wp.func
def draw_place(places: wp.array(dtype=float), first: int, count: int, xi: float) -> Place:
    """Draws one of `count` places by a uniform xi; not one without a share.

    places: among other numbers, from `first` on, count + 1 cumulative shares from 0 to 1.
    """
    low = int(0)
    high = int(count - 1)
    while low < high:
        middle = (low + high) // 2
        if places[first + middle + 1] <= xi:
            low = middle + 1
        else:
            high = middle
    place = Place()
    place.item = low
    place.share = places[first + low + 1] - places[first + low]
    place.within = wp.clamp((xi - places[first + low]) / wp.max(place.share, 1.0e-37), 0.0, 1.0)
    return place


@wp.func
def sample_towards(position: wp.vec3, point: wp.vec3) -> LightSample:
    """Direction and distance to a point; radiance and pdf are still 0."""
    sample = LightSample()
    to_point = point - position
    sample.distance = wp.length(to_point)
    sample.direction = to_point / wp.max(sample.distance, 1.0e-30)
    return sample

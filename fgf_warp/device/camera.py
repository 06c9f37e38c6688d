"""The camera: a pinhole, and beyond it a thin lens, parallel rays, clipping planes and motion."""

import warp as wp

from fgf_warp.device.numerics import INFINITE, sincos_turns, unit

LEAST_COSINE = wp.constant(1e-7)
"""Of a camera ray with the view axis: rounding may turn the smallest ones negative."""


@wp.struct
class Camera:
    """What rays begin at, and the image's window on the film.

    The window lies on the plane at unit distance, or where rays are parallel, around the camera in stage units.
    """

    position: wp.vec3
    right: wp.vec3
    up: wp.vec3
    forward: wp.vec3
    """Unit vectors of the camera's axes in world space."""
    left_edge: float
    top_edge: float
    pixel_width: float
    pixel_height: float
    """The window's upper left corner and a pixel's size."""
    width: int
    """[pixel]."""
    is_orthographic: int
    lens_radius: float
    """[stage unit]; 0 of a pinhole."""
    nearness: float
    """1 / focus distance [1/stage unit]."""
    near: float
    far: float
    """Distances of the clipping planes along the view axis [stage unit]; the far one may be INFINITE."""
    closing_position: wp.vec3
    closing_right: wp.vec3
    closing_up: wp.vec3
    closing_forward: wp.vec3
    """When the shutter closes."""


@wp.struct
class CameraRay:
    """Where a path begins, and its unit direction."""

    origin: wp.vec3
    direction: wp.vec3


@wp.func(inline=True)
def film_point(camera: Camera, row: int, column: int, xi1: float, xi2: float) -> wp.vec2:
    """A point of a pixel in the window; rows are counted from the top."""
    x = camera.left_edge + (float(column) + xi1) * camera.pixel_width
    y = camera.top_edge - (float(row) + xi2) * camera.pixel_height
    return wp.vec2(x, y)


@wp.func(inline=True)
def camera_direction(camera: Camera, row: int, column: int, xi1: float, xi2: float) -> wp.vec3:
    """Unit direction from the pinhole through a point of a pixel."""
    film = film_point(camera, row, column, xi1, xi2)
    return unit(camera.forward + camera.right * film[0] + camera.up * film[1])


@wp.func(inline=True)
def camera_ray(camera: Camera, film: wp.vec2, xi1: float, xi2: float) -> CameraRay:
    """From the near plane, through a point of the lens, to where the film's point is sharp; parallel rays have no lens.

    xi1, xi2: the point of the lens, uniform on its disc.
    """
    radius = camera.lens_radius * wp.sqrt(xi1)
    sine, cosine = sincos_turns(xi2)
    lens_x = radius * cosine
    lens_y = radius * sine
    is_parallel = camera.is_orthographic == 1
    # Sideways and upwards: where the ray is at distance 0 along the view axis, and how much it moves per unit of it.
    x = wp.where(is_parallel, film[0], lens_x)
    y = wp.where(is_parallel, film[1], lens_y)
    slope_x = wp.where(is_parallel, 0.0, film[0] - lens_x * camera.nearness)
    slope_y = wp.where(is_parallel, 0.0, film[1] - lens_y * camera.nearness)
    along = camera.forward + camera.right * slope_x + camera.up * slope_y
    ray = CameraRay()
    ray.origin = camera.position + camera.right * x + camera.up * y + along * camera.near
    ray.direction = unit(along)
    return ray


@wp.func(inline=True)
def far_distance(camera: Camera, direction: wp.vec3) -> float:
    """Length of a camera ray from the near plane to the far one; INFINITE where there is none."""
    cosine = wp.max(wp.dot(direction, camera.forward), LEAST_COSINE)
    return wp.min((camera.far - camera.near) / cosine, INFINITE)


@wp.func(inline=True)
def camera_at(camera: Camera, time: float) -> Camera:
    """The camera at a time of the shutter: it moves linearly, and its axes stay unit vectors."""
    moved = camera
    moved.position = camera.position * (1.0 - time) + camera.closing_position * time
    moved.right = unit(camera.right * (1.0 - time) + camera.closing_right * time)
    moved.up = unit(camera.up * (1.0 - time) + camera.closing_up * time)
    moved.forward = unit(camera.forward * (1.0 - time) + camera.closing_forward * time)
    return moved


@wp.func
def camera_at_closing(camera: Camera) -> Camera:
    """The camera at the end, to the bit: what rests is then seen to rest."""
    moved = camera
    moved.position = camera.closing_position
    moved.right = camera.closing_right
    moved.up = camera.closing_up
    moved.forward = camera.closing_forward
    return moved


@wp.func
def pixel_of(camera: Camera, position: wp.vec3) -> wp.vec3:
    """Where a sharp picture shows a point: columns from the left, rows from the top, and its depth [stage unit]."""
    to_point = position - camera.position
    depth = wp.dot(to_point, camera.forward)
    scale = wp.where(camera.is_orthographic == 1, 1.0, depth)
    x = wp.dot(to_point, camera.right) / scale
    y = wp.dot(to_point, camera.up) / scale
    return wp.vec3((x - camera.left_edge) / camera.pixel_width, (camera.top_edge - y) / camera.pixel_height, depth)

"""The pinhole camera."""

import warp as wp

from fgf_warp.device.numerics import unit


@wp.struct
class Camera:
    """A pinhole and the image's window on the plane at unit distance."""

    position: wp.vec3
    right: wp.vec3
    up: wp.vec3
    forward: wp.vec3
    """Unit vectors of the camera's axes in world space."""
    left_edge: float
    top_edge: float
    pixel_width: float
    pixel_height: float
    """The window's upper left corner and a pixel's size, at unit distance."""
    width: int
    """[pixel]."""


@wp.func(inline=True)
def camera_direction(camera: Camera, row: int, column: int, xi1: float, xi2: float) -> wp.vec3:
    """Unit direction through a point of a pixel; rows are counted from the top."""
    x = camera.left_edge + (float(column) + xi1) * camera.pixel_width
    y = camera.top_edge - (float(row) + xi2) * camera.pixel_height
    return unit(camera.forward + camera.right * x + camera.up * y)

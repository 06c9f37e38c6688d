"""The pinhole camera."""

import warp as wp


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


@wp.func
def camera_direction(camera: Camera, pixel: int, xi1: float, xi2: float) -> wp.vec3:
    """Unit direction through a point of the pixel; pixels are counted along rows from the top left."""
    column = pixel % camera.width
    row = pixel // camera.width
    x = camera.left_edge + (float(column) + xi1) * camera.pixel_width
    y = camera.top_edge - (float(row) + xi2) * camera.pixel_height
    return wp.normalize(camera.forward + camera.right * x + camera.up * y)

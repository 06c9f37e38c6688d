"""What the picture says of a prim beside its light: which it is, and how it moves."""

import warp as wp

from fgf_warp.device.camera import Camera, camera_at, pixel_of


@wp.struct
class Prim:
    """Of a surface or a container."""

    number: int
    """Of its name among those of the scene, from 1 on."""
    instance: int
    """In its instancer, or -1."""
    drift: wp.mat33
    drift_offset: wp.vec3
    """How far a point moves while the shutter is open: drift * p + offset, where p is its place at the opening."""


@wp.func
def image_motion(camera: Camera, prim: Prim, position: wp.vec3, time: float) -> wp.vec3:
    """How far the picture of a point of a prim moves while the shutter is open, to the right and down [pixel].

    0 where it is behind the camera at the opening or the closing. The third number is 0.

    position: of the point at this time.
    """
    moved = wp.identity(n=3, dtype=float) + prim.drift * time
    opening = wp.inverse(moved) * (position - prim.drift_offset * time)
    closing = opening + prim.drift * opening + prim.drift_offset
    first = pixel_of(camera, opening)
    last = pixel_of(camera_at(camera, 1.0), closing)
    if first[2] <= 0.0 or last[2] <= 0.0:
        return wp.vec3(0.0, 0.0, 0.0)
    return wp.vec3(last[0] - first[0], last[1] - first[1], 0.0)

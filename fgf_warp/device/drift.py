"""How what is seen moves in the image."""

import warp as wp

from fgf_warp.device.camera import Camera, camera_at_closing, pixel_of


@wp.struct
class Drift:
    """How far a point moves while the shutter is open: slope * p + offset, where p is its place at the opening."""

    slope: wp.mat33
    offset: wp.vec3


@wp.func
def image_motion(camera: Camera, drift: Drift, position: wp.vec3, time: float) -> wp.vec3:
    """How far the picture of a point moves while the shutter is open, to the right and down [pixel].

    0 where it is behind the camera at the opening or the closing. The third number is 0.

    position: of the point at this time.
    """
    moved = wp.identity(n=3, dtype=float) + drift.slope * time
    opening = wp.inverse(moved) * (position - drift.offset * time)
    closing = opening + drift.slope * opening + drift.offset
    first = pixel_of(camera, opening)
    last = pixel_of(camera_at_closing(camera), closing)
    if first[2] <= 0.0 or last[2] <= 0.0:
        return wp.vec3(0.0, 0.0, 0.0)
    return wp.vec3(last[0] - first[0], last[1] - first[1], 0.0)

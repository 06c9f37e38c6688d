"""Scenes with known answers, in code."""

import math

import numpy as np

from fgf_warp.scene import Camera, DomeLight, Instances, Medium, Mesh, Scene, Solid, Surface


def transform(scale=(1.0, 1.0, 1.0), at=(0.0, 0.0, 0.0)) -> np.ndarray:
    matrix = np.diag([*np.broadcast_to(scale, 3), 1.0]).astype(np.float64)
    matrix[:3, 3] = at
    return matrix


def instance_of(name: str, mesh: Mesh, matrix: np.ndarray, closing: np.ndarray | None = None, **links) -> Instances:
    """A mesh in one place, (4, 4)."""
    return Instances(name, mesh, matrix[None, :3], None if closing is None else closing[None, :3], **links)


def camera(position, towards, *, aperture=1.0, focal_length=1.0) -> Camera:
    """A square camera at `position` that looks at `towards`."""
    position, towards = np.asarray(position, dtype=np.float64), np.asarray(towards, dtype=np.float64)
    back = (position - towards) / np.linalg.norm(position - towards)
    right = np.cross([0.0, 1.0, 0.0] if abs(back[1]) < 0.9 else [1.0, 0.0, 0.0], back)
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3, :4] = np.column_stack([right, np.cross(back, right), back, position])
    return Camera("/camera", matrix, focal_length, aperture, aperture)


def furnace(*, sky=(1.0, 1.0, 1.0), fills_view=True, **medium) -> Scene:
    """The unit sphere, full of a medium of sigma_m 2.5, in a uniform sky.

    With `fills_view` the camera sees nothing but the sphere's disc.
    """
    medium = {"mean_extinction": 2.5, "albedo": (1.0, 1.0, 1.0)} | medium
    return Scene(
        camera((0, 0, 5), (0, 0, 0), aperture=0.28 if fills_view else 0.6),
        shapes=(Solid("/sphere", "sphere", np.eye(4), medium=0),),
        media=(Medium("/medium", **medium),),
        lights=(DomeLight("/sky", sky),),
    )


WIDE = 1e7
FAR = 1e3


def law_of(b: float, kappa: float) -> dict[str, float]:
    """Parameters of a medium of this law: b alone enters it, H follows from b, and b = 1 is any H of an fBm."""
    return dict(hurst=(b - 1) / 2 if b < 1 else 0.5, kappa=kappa)


def slab(thickness: float, *, incidence: str | float, **medium) -> Scene:
    """An unbounded slab below z = 0, sigma_m = 1, whose reflectance is the red and transmittance the green of a pixel.

    A path is a particle that enters from the camera's side. Red is the sky above; green glows from a plane far
    below. With Lambert incidence the camera sees the underside of a small white patch high above the slab; otherwise
    `incidence` is the cosine of the angle at which it looks down.
    """
    block = Solid("/slab", "cube", transform((WIDE, WIDE, thickness / 2), (0, 0, -thickness / 2)), medium=0)
    depth = thickness + FAR
    below = Solid("/below", "cube", transform((WIDE, WIDE, 1.0), (0, 0, -depth)), Surface((0, 0, 0), (0, 1, 0)))
    shapes = [below, block]
    if incidence == "lambert":
        shapes.append(Solid("/patch", "cube", transform(1.0, (0, 0, FAR + 1.0)), Surface((1.0, 1.0, 1.0))))
        view = camera((0, 0, FAR - 1.0), (0, 0, FAR), aperture=1e-3)
    else:
        view = camera((100 * math.sqrt(1 - incidence**2), 0, 100 * incidence), (0, 0, 0), aperture=1e-5)
    return Scene(
        view,
        shapes=tuple(shapes),
        media=(Medium("/medium", mean_extinction=1.0, **medium),),
        lights=(DomeLight("/sky", (1.0, 0.0, 0.0)),),
    )

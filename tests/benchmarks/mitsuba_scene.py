"""From a scene of ours to one of Mitsuba's, for what the benchmark's scenes are made of."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from fgf_warp.scene import AreaLight, Camera, DomeLight, Light, Medium, Mesh, Scene, Shape
from tests.benchmarks.scenes import Bounds, Image

MI_CAMERA = np.diag([-1.0, 1.0, -1.0, 1.0])
"""Mitsuba's cameras look along +z, with +x to the left."""


def to_mitsuba(
    scene: Scene, image: Image, bounds: Bounds, folder: Path, *, emitter_sampling: bool = True
) -> dict[str, Any]:
    """The argument of `mitsuba.load_dict`.

    Args:
        scene: of media that do not overlap, with the camera outside of them.
        image: size of the picture.
        bounds: of the paths.
        folder: for the files of meshes.
        emitter_sampling: False lets scattering events in media find the lights by the phase function only.

    Raises:
        ValueError: for what has no counterpart in Mitsuba, or none that is translated here.
    """
    media = [_medium(values, emitter_sampling) for values in scene.media]
    shapes = [_shape(shape, media, folder) for shape in scene.shapes]
    lights = [_light(light) for light in scene.lights]
    return {
        "type": "scene",
        # Mitsuba's max_depth counts segments: a path of n scattering events has n + 1 of them.
        "integrator": {"type": "volpath", "max_depth": bounds.max_depth + 1, "rr_depth": bounds.roulette_depth},
        "sensor": _sensor(scene.camera, image),
        **{f"shape{i}": shape for i, shape in enumerate(shapes)},
        **{f"light{i}": light for i, light in enumerate(lights)},
    }


def _sensor(camera: Camera, image: Image) -> dict[str, Any]:
    left, right, bottom, top = camera.window(image.width, image.height)
    if not (math.isclose(left, -right) and math.isclose(bottom, -top)):
        raise ValueError(f"{camera.name}: a film that is not centred is not translated")
    return {
        "type": "perspective",
        "fov_axis": "x",
        "fov": 2 * math.degrees(math.atan(right)),
        "near_clip": 1e-3,
        "far_clip": 1e4,
        "to_world": _transform(camera.camera_to_world @ MI_CAMERA),
        "film": {
            "type": "hdrfilm",
            "width": image.width,
            "height": image.height,
            "rfilter": {"type": "box"},
            "pixel_format": "rgb",
            "component_format": "float32",
        },
        "sampler": {"type": "independent"},
    }


def _medium(medium: Medium, emitter_sampling: bool) -> dict[str, Any]:
    grey = len(set(medium.albedo)) == 1 and not medium.is_chromatic
    if not (grey and medium.line_law.kind == "exponential" and medium.phase_function == "hg"):
        raise ValueError(
            f"{medium.name}: only grey media of exponential transmittance and Henyey-Greenstein's phase function are "
            "translated"
        )
    return {
        "type": "homogeneous",
        "sigma_t": medium.mean_extinction,
        "albedo": medium.albedo[0],
        "phase": {"type": "hg", "g": medium.asymmetry},
        "has_spectral_extinction": False,
        "sample_emitters": emitter_sampling,
    }


def _shape(shape: Shape, media: list[dict[str, Any]], folder: Path) -> dict[str, Any]:
    found: dict[str, Any]
    if isinstance(shape, Mesh):
        found = {"type": "ply", "filename": str(_write_ply(shape, folder)), "face_normals": True}
    elif shape.kind in ("sphere", "cube"):
        found = {"type": shape.kind, "to_world": _transform(shape.object_to_world)}
    else:
        raise ValueError(f"{shape.name}: a {shape.kind} is not translated")
    if shape.surface is None:
        found["bsdf"] = {"type": "null"}
    elif any(shape.surface.emission):
        raise ValueError(f"{shape.name}: a surface that glows is not translated")
    else:
        found["bsdf"] = {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": _rgb(shape.surface.diffuse)}}
    if shape.medium is not None:
        found["interior"] = media[shape.medium]
    return found


def _light(light: Light) -> dict[str, Any]:
    if isinstance(light, DomeLight):
        return {"type": "constant", "radiance": _rgb(light.radiance)}
    if not (isinstance(light, AreaLight) and light.shape == "rect"):
        raise ValueError(f"{light.name}: this kind of light is not translated")
    to_world = np.eye(4)
    normal = np.cross(light.half_u, light.half_v)
    to_world[:3] = np.column_stack([light.half_u, light.half_v, normal / np.linalg.norm(normal), light.center])
    return {
        "type": "rectangle",
        "to_world": _transform(to_world),
        "bsdf": {"type": "diffuse", "reflectance": 0.0},
        "emitter": {"type": "area", "radiance": _rgb(light.radiance)},
    }


def _write_ply(mesh: Mesh, folder: Path) -> Path:
    path = folder / f"{mesh.name.strip('/').replace('/', '_')}.ply"
    faces = np.empty(len(mesh.triangles), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, mesh.triangles
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(mesh.points)}\nproperty float x\nproperty float y\n"
        f"property float z\nelement face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    path.write_bytes(header.encode() + mesh.points.astype("<f4").tobytes() + faces.tobytes())
    return path


def _rgb(color: tuple[float, float, float]) -> dict[str, Any]:
    return {"type": "rgb", "value": list(color)}


def _transform(matrix: np.ndarray) -> Any:
    import mitsuba as mi

    return mi.ScalarTransform4f(matrix)

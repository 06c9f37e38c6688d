"""Lights in float64: their images and shaping from the definitions, and irradiance by quadrature."""

import numpy as np

from fgf_warp.scene import AreaLight, CylinderLight, DomeLight, Image, MeshLight, SphereLight


def grey_image(values, *, is_srgb: bool = False) -> Image:
    """One grey value per texel: float32, or uint8 of values in [0, 1]."""
    pixels = np.repeat(np.asarray(values, dtype=np.float32)[..., None], 4, axis=-1)
    return Image("image", (pixels * 255).astype(np.uint8) if is_srgb else pixels, is_srgb)


def bilinear(image: Image, s, t, *, is_round: bool):
    """Red of a linear image between the centers of its texels, t from the top."""
    red = image.pixels[..., 0].astype(np.float64)
    height, width = red.shape
    x, y = s * width - 0.5, t * height - 0.5
    left, top = np.floor(x).astype(int), np.floor(y).astype(int)
    x, y = x - left, y - top
    columns = [(left + k) % width if is_round else np.clip(left + k, 0, width - 1) for k in (0, 1)]
    rows = [np.clip(top + k, 0, height - 1) for k in (0, 1)]
    upper, lower = (red[row, columns[0]] * (1 - x) + red[row, columns[1]] * x for row in rows)
    return upper * (1 - y) + lower * y


def shaping_factor(shaping, emitted):
    """Red of the formulas of UsdLux.ShapingAPI, for unit directions (..., 3)."""
    cosine = emitted @ np.asarray(shaping.axis)
    off_axis = 2 * np.arcsin(np.minimum(np.linalg.norm(emitted - shaping.axis, axis=-1) / 2, 1))
    start = shaping.cone_angle * (1 - shaping.cone_softness)
    x = np.clip((off_axis - start) / max(shaping.cone_angle - start, 1e-300), 0, 1)
    fade = np.where(off_axis > start, 1 - x * x * (3 - 2 * x), 1.0)
    focus = np.abs(cosine) ** shaping.focus
    return np.where(off_axis > shaping.cone_angle, 0.0, fade) * (focus + (1 - focus) * shaping.focus_tint[0])


def midpoints(count: int, low: float, high: float):
    return low + (np.arange(count) + 0.5) * (high - low) / count


def irradiance(light, position=(0.0, 0.0, 0.0), *, points: int = 500) -> float:
    """On a plane that faces +z, in red, with nothing between."""
    if isinstance(light, DomeLight):
        return _dome_irradiance(light, points)
    at, normals, areas, image = surface(light, points)
    towards = at - np.asarray(position)
    distance = np.linalg.norm(towards, axis=-1)
    direction = towards / distance[..., None]
    cosines = np.maximum(direction[..., 2], 0) * np.maximum(-np.einsum("...i,...i", direction, normals), 0)
    sent = light.radiance[0] * image
    if light.shaping is not None:
        sent = sent * shaping_factor(light.shaping, -direction)
    return float((sent * cosines / distance**2 * areas).sum())


def surface(light, points: int):
    """Points, normals, areas and the image's red of pieces of a light."""
    if isinstance(light, AreaLight) and light.shape == "rect":
        a, b = np.meshgrid(midpoints(points, -1, 1), midpoints(points, -1, 1))
        at = np.asarray(light.center) + a[..., None] * light.half_u + b[..., None] * light.half_v
        image = np.ones_like(a)
        if light.image is not None:
            s, t = (row[0] * a + row[1] * b + row[2] for row in light.image_axes)
            image = bilinear(light.image, s, 1 - t, is_round=False)
        normal = np.cross(light.half_u, light.half_v)
        return at, np.broadcast_to(normal / np.linalg.norm(normal), at.shape), light.area / a.size, image
    if isinstance(light, AreaLight):
        r, phi = np.meshgrid(np.sqrt(midpoints(points, 0, 1)), midpoints(points, 0, 2 * np.pi))
        at = (r * np.cos(phi))[..., None] * light.half_u + (r * np.sin(phi))[..., None] * light.half_v + light.center
        normal = np.cross(light.half_u, light.half_v)
        return at, np.broadcast_to(normal / np.linalg.norm(normal), at.shape), light.area / r.size, 1.0
    if isinstance(light, SphereLight):
        z, phi = np.meshgrid(midpoints(points, -1, 1), midpoints(points, 0, 2 * np.pi))
        sine = np.sqrt(1 - z * z)
        normals = np.stack([sine * np.cos(phi), sine * np.sin(phi), z], axis=-1)
        return light.center + light.radius * normals, normals, light.area / z.size, 1.0
    if isinstance(light, CylinderLight):
        z, phi = np.meshgrid(midpoints(points, -1, 1), midpoints(points, 0, 2 * np.pi))
        axis = np.asarray(light.half_axis) / np.linalg.norm(light.half_axis)
        across = np.cross(axis, [0.36, 0.48, 0.8])
        across /= np.linalg.norm(across)
        normals = np.cos(phi)[..., None] * across + np.sin(phi)[..., None] * np.cross(axis, across)
        at = light.center + light.radius * normals + z[..., None] * light.half_axis
        return at, normals, light.area / z.size, 1.0
    assert isinstance(light, MeshLight)
    u, v = np.meshgrid(midpoints(points, 0, 1), midpoints(points, 0, 1))
    u, v = u.ravel(), v.ravel()
    folded = u + v > 1
    u, v = np.where(folded, 1 - u, u), np.where(folded, 1 - v, v)
    a, b, c = (light.corners[:, corner, None] for corner in range(3))
    at = a + (b - a) * u[:, None] + (c - a) * v[:, None]
    normals = np.cross(b - a, c - a)
    normals = np.broadcast_to(normals / np.linalg.norm(normals, axis=-1, keepdims=True), at.shape)
    return at, normals, light.areas[:, None] / u.size, 1.0


def _dome_irradiance(light: DomeLight, points: int) -> float:
    z, phi = np.meshgrid(np.sqrt(midpoints(points, 0, 1)), midpoints(2 * points, 0, 2 * np.pi))
    sine = np.sqrt(1 - z * z)
    direction = np.stack([sine * np.cos(phi), sine * np.sin(phi), z], axis=-1)
    sent = light.radiance[0] * dome_image(light, direction)
    if light.shaping is not None:
        sent = sent * shaping_factor(light.shaping, -direction)
    # Even in the square of the cosine: the cosine is in the density of the directions.
    return float(np.pi * sent.mean())


def dome_image(light: DomeLight, direction):
    """Red of a dome's image, by the latitude and longitude of OpenEXR: +z is longitude 0, +x is pi / 2."""
    if light.image is None:
        return np.ones(direction.shape[:-1])
    x, y, z = np.moveaxis(direction @ np.array(light.light_to_world), -1, 0)
    longitude, latitude = np.arctan2(x, z), np.arcsin(np.clip(y, -1, 1))
    return bilinear(light.image, (np.pi - longitude) / (2 * np.pi), (np.pi / 2 - latitude) / np.pi, is_round=True)

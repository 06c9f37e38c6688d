"""Lights of any kind, one by one, with images and shaping: functions that are built for the kinds of a scene."""

from typing import Any

import warp as wp

from fgf_warp.device.geometry import LIGHT, Hit
from fgf_warp.device.lights.data import (
    CYLINDER_LIGHT,
    DISK,
    DISTANT,
    DOME,
    MESH_LIGHT,
    RECT,
    SPHERE_LIGHT,
    Light,
    LightSample,
    LightTables,
)
from fgf_warp.device.lights.images import (
    dome_coordinates,
    dome_pdf,
    filter_image,
    rect_coordinates,
    rect_image_pdf,
    sample_dome,
    sample_rect_image,
)
from fgf_warp.device.lights.plain import cone_pdf, emitted_radiance, intersect_light, light_pdf, sample_light
from fgf_warp.device.lights.shapes import (
    cylinder_distance,
    cylinder_normal,
    cylinder_pdf,
    facing_pdf,
    sample_cylinder,
    sample_mesh,
)


@wp.func
def shaping(light: Light, direction: wp.vec3) -> wp.vec3:
    """Share of its radiance, per channel, that a shaped light sends against `direction`, as UsdLux.ShapingAPI says.

    Error below 1e-4 of the peak; 2e-3 in the soft edge of a narrow cone.
    """
    emitted = -direction
    cosine = wp.dot(light.axis, emitted)
    angle = wp.atan2(wp.length(wp.cross(light.axis, emitted)), cosine)
    if angle > light.cone_angle:
        return wp.vec3(0.0)
    faded = float(0.0)
    if angle > light.fade_angle:
        x = (angle - light.fade_angle) / (light.cone_angle - light.fade_angle)
        faded = x * x * (3.0 - 2.0 * x)
    focused = wp.pow(wp.abs(cosine), light.focus)
    return (light.focus_tint * (1.0 - focused) + wp.vec3(focused)) * (1.0 - faded)


def build_lights(kinds: frozenset[int], has_images: bool, has_shaping: bool) -> tuple[Any, Any, Any, Any]:
    """Functions on one light of a scene.

    Args:
        kinds: of the scene's lights, of the constants of `lights.data`.
        has_images: whether some have images.
        has_shaping: whether some are shaped.

    Returns:
        `intersect_lights`, `sample_any_light`, `any_light_pdf` and `any_radiance`.
    """

    @wp.func
    def intersect_lights(lights: wp.array(dtype=Light), origin: wp.vec3, direction: wp.vec3, nearest: Hit) -> Hit:
        """`nearest`, or the light with a shape before it; triangles are met among the meshes."""
        hit = nearest
        for i in range(lights.shape[0]):
            kind = lights[i].kind
            if kind == RECT or kind == DISK or kind == SPHERE_LIGHT:
                hit = intersect_light(lights[i], kind, i, origin, direction, hit)
            if wp.static(int(CYLINDER_LIGHT) in kinds):
                if kind == CYLINDER_LIGHT:
                    t = cylinder_distance(lights[i], origin, direction)
                    if t < hit.t:
                        hit.t = t
                        hit.kind = LIGHT
                        hit.item = i
        return hit

    @wp.func
    def any_radiance(light: Light, tables: LightTables, hit: Hit, position: wp.vec3, direction: wp.vec3) -> wp.vec3:
        """What a light sends against `direction`, from a point of it unless it is beyond the scene.

        hit: with the normal, of a mesh.
        """
        radiance = light.radiance
        if light.kind == RECT or light.kind == DISK:
            radiance = emitted_radiance(light, light.kind, direction)
        if wp.static(int(CYLINDER_LIGHT) in kinds):
            if light.kind == CYLINDER_LIGHT and wp.dot(cylinder_normal(light, position), direction) >= 0.0:
                radiance = wp.vec3(0.0)
        if wp.static(int(MESH_LIGHT) in kinds):
            if light.kind == MESH_LIGHT and wp.dot(hit.normal, direction) >= 0.0:
                radiance = wp.vec3(0.0)
        if wp.static(has_images):
            if light.image >= 0:
                st = wp.vec2()
                if light.kind == RECT:
                    st = rect_coordinates(light, position)
                else:
                    st = dome_coordinates(light.to_light * direction)
                radiance = wp.cw_mul(radiance, filter_image(light, tables, st[0], st[1]))
        if wp.static(has_shaping):
            if light.is_shaped == 1:
                radiance = wp.cw_mul(radiance, shaping(light, direction))
        return radiance

    @wp.func
    def any_light_pdf(
        light: Light, tables: LightTables, hit: Hit, vertex: wp.vec3, position: wp.vec3, direction: wp.vec3
    ) -> float:
        """pdf_solid_angle [1/sr] with which `sample_any_light` at `vertex` gives this direction.

        hit: with the normal, of a mesh.
        position: of the light's point in that direction.
        """
        if light.kind == DISTANT:
            return cone_pdf(light.cone)
        if wp.static(int(DOME) in kinds):
            if light.kind == DOME:
                return dome_pdf(light, tables, direction)
        if wp.static(int(CYLINDER_LIGHT) in kinds):
            if light.kind == CYLINDER_LIGHT:
                return cylinder_pdf(light, vertex, cylinder_normal(light, position), direction)
        if wp.static(int(MESH_LIGHT) in kinds):
            if light.kind == MESH_LIGHT:
                return facing_pdf(light, hit.normal, direction, wp.length(position - vertex))
        if wp.static(has_images):
            if light.image >= 0:
                return rect_image_pdf(light, tables, vertex, position, direction)
        return light_pdf(light, light.kind, vertex, position, direction)

    @wp.func
    def sample_any_light(light: Light, tables: LightTables, position: wp.vec3, xi1: float, xi2: float) -> LightSample:
        """A direction from `position` towards this light, from two uniforms, with what it sends from there."""
        sample = LightSample()
        is_done = bool(False)
        if wp.static(int(DOME) in kinds):
            if light.kind == DOME:
                sample = sample_dome(light, tables, xi1, xi2)
                is_done = True
        if wp.static(int(CYLINDER_LIGHT) in kinds):
            if light.kind == CYLINDER_LIGHT:
                sample = sample_cylinder(light, position, xi1, xi2)
                is_done = True
        if wp.static(int(MESH_LIGHT) in kinds):
            if light.kind == MESH_LIGHT:
                sample = sample_mesh(light, tables, position, xi1, xi2)
                is_done = True
        if wp.static(has_images):
            if light.kind == RECT and light.image >= 0:
                sample = sample_rect_image(light, tables, position, xi1, xi2)
                is_done = True
        if not is_done:
            sample = sample_light(light, light.kind, position, xi1, xi2)
        if sample.pdf_solid_angle > 0.0:
            # A point with a density is seen from the front.
            hit = Hit()
            hit.normal = -sample.direction
            point = position + sample.direction * wp.min(sample.distance, 1.0e30)
            sample.radiance = any_radiance(light, tables, hit, point, sample.direction)
        if light.casters != wp.uint32(0):
            sample.only_connected = 1
        return sample

    return intersect_lights, sample_any_light, any_light_pdf, any_radiance

"""The driver of CUDA: a thread takes the samples of one pixel, one path after the other, through all stages."""

from typing import Any

import warp as wp

from fgf_warp.device.bsdf import Bsdf
from fgf_warp.device.geometry import MISS
from fgf_warp.device.lights import DISTANT
from fgf_warp.device.options import kernel_options
from fgf_warp.features import RenderFeatures
from fgf_warp.integrator.media_lookup import needs_look_up
from fgf_warp.integrator.scene_data import scene_struct
from fgf_warp.integrator.stages import Stages
from fgf_warp.integrator.work import Counts, Limits, Round, samples_of_round
from fgf_warp.settings import Aov


def build_render_threads(features: RenderFeatures, stages: Stages) -> Any:
    """The kernel (scene, limits, film, images, pixel_count, counts, round) over (images, pixels)."""
    Path, SceneData, Film = stages.path.struct, scene_struct(features), stages.tally.film
    intersect = build_intersect(features, stages)
    birth, flight, medium, tally = stages.birth, stages.flight, stages.medium, stages.tally
    scene_of_image, lone_medium, draw_rates = stages.scene_of_image, stages.lone_medium, stages.laws.draw_rates
    shading, look_up_media, interact = stages.shading, stages.look_up_media, stages.interact
    next_event, russian_roulette, track = stages.next_event, stages.russian_roulette, stages.track
    looks_up = needs_look_up(features)
    freezes_at_birth = features.frozen and bool(features.lone_law)
    tracks = Aov.MOTION in features.aovs

    @wp.kernel(module="unique", module_options=kernel_options(features.meshes))
    def render_threads(
        batch: SceneData,
        limits: Limits,
        film: Film,
        images: wp.array(dtype=int),
        pixel_count: int,
        counts: Counts,
        part: Round,
    ):
        slot, rank = wp.tid()
        image = images[slot]
        pixel = counts.order[image * pixel_count + rank]
        scene = scene_of_image(batch, image)
        seed = scene.seeds[image]
        lone = lone_medium(scene)
        place = image * pixel_count + pixel
        sums = tally.read(film, place)
        waiting = birth.go_to_pixel(Path(), scene.camera.width, seed, pixel)
        inside = wp.uint32(0)
        if wp.static(features.media):
            inside = scene.camera_inside
        environment = wp.vec3(0.0)
        if wp.static(features.environment):
            environment = scene.environment
        first_sample, end_sample = samples_of_round(counts, part, place)
        for sample in range(first_sample, end_sample):
            waiting.sample = sample
            path = birth.emit(scene.camera, inside, seed, waiting)
            if wp.static(features.varied_starts):
                path = birth.find_start(scene, path)
            if wp.static(freezes_at_birth):
                path.rates = draw_rates(scene, path, lone, 0, seed)
            while path.alive == 1:
                path = flight.begin_event(path, seed)
                path = medium.sample_free_flight(scene, lone, path, seed)
                path = intersect(scene, path)
                bsdf = Bsdf()
                if wp.static(features.shading):
                    if shading.reaches_surface(path):
                        path, bsdf = shading.shade(scene, path, seed)
                if wp.static(looks_up):
                    path = look_up_media(scene, path)
                path = interact(path, lone, environment, scene.camera, limits)
                if wp.static(features.connections):
                    if path.scatters != MISS:
                        path = next_event(scene, lone, path, bsdf, seed)
                path = russian_roulette(path, limits)
            if wp.static(tracks):
                path = track(scene, path)
            sums = tally.add(sums, path, True)
        tally.write(film, place, sums)

    return render_threads


def build_intersect(features: RenderFeatures, stages: Stages) -> Any:
    """The function (scene, path) -> Path, with the nearest of all that is ahead of one path."""
    Path, SceneData = stages.path.struct, scene_struct(features)
    shapes, lights, begin_ray = stages.shapes, stages.lights, stages.flight.begin_ray

    @wp.func
    def intersect(scene: SceneData, before: Path) -> Path:
        path = before
        if wp.static(bool(features.lone_solid)):
            solid = scene.solids[scene.lone_solid]
            path = shapes.lone_solid(path, solid, solid.kind)
        path = begin_ray(path, scene.camera)
        if wp.static(bool(features.solids)):
            path = shapes.solids(scene, path)
        if wp.static(features.meshes):
            path = shapes.take_mesh_hit(path, shapes.meshes(scene.meshes, path), scene)
        if wp.static(features.intricate_lights):
            path = lights.lights(scene, path)
        elif wp.static(features.connections):
            if wp.static(bool(features.shaped_lights)):
                for k in range(scene.lights.shape[0]):
                    light = scene.lights[k]
                    if light.kind != DISTANT:
                        path = lights.light(path, light, light.kind, k)
            if wp.static(features.distant_lights):
                for k in range(scene.lights.shape[0]):
                    path = lights.beyond(path, scene.lights[k])
        return path

    return intersect

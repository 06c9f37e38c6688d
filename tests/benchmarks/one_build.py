"""Builds the kernel of a scene with the source tree that PYTHONPATH names, and prints the seconds that it took.

Run as a file, `one_build.py STAGE` or `one_build.py full`, by `builds`, each time in a process and a kernel cache of
its own. The seconds are those of the processor, of user and system, with children; Warp and the scene are there before.
"""

import os
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import warp as wp

from fgf_warp.finishing import render_image
from fgf_warp.scene import (
    AreaLight,
    Camera,
    CylinderLight,
    DistantLight,
    DomeLight,
    Image,
    Medium,
    Mesh,
    MeshLight,
    Scene,
    Shaping,
    Solid,
    SphereLight,
    Surface,
    Texture,
    TextureInput,
)
from fgf_warp.settings import RENDERED_AOVS, RenderSettings
from usd_scenes.reader import read_scene

FULL = "full"
SETTINGS = RenderSettings(width=8, height=8, spp=1, threads=1)
DOWN = (0.0, -1.0, 0.0)


def place(scale: float, x: float, y: float = 0.0, z: float = 0.0) -> np.ndarray:
    """(4, 4) stretches, then moves."""
    matrix = np.diag([scale, scale, scale, 1.0])
    matrix[:3, 3] = x, y, z
    return matrix


def full_scene() -> Scene:
    """All that a kernel can be built for, but similar media, which exclude the exact variance."""
    image = Image("image", np.random.default_rng(1).random((4, 4, 4)).astype(np.float32))
    read = TextureInput(Texture({(0, 0): image}))
    fog = Medium("/fog", mean_extinction=2.5, albedo=(0.8,) * 3, asymmetry=0.4, extinction_color=(1.0, 2.0, 3.0))
    mixed = {"hurst": -0.25, "white_noise_scale": 2.0, "transport": "mixed"}
    exact = {"hurst": 0.1, "white_noise_scale": 0.5, "outer_scale": 12.0, "line_variance": "exact"}
    media = (
        fog,
        replace(fog, name="/even", phase_function="isotropic", asymmetry=0.0, **mixed),
        replace(fog, name="/lobes", phase_function="two_lobe", back_asymmetry=-0.5, back_weight=0.3, priority=1),
        replace(fog, name="/dust", phase_function="draine", draine_alpha=1.0, **exact),
    )
    glass = Surface(opacity=0.0, ior=1.5, roughness=0.2)
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    beads = [Solid(f"/bead{k}", "sphere", place(0.01, 0.03 * k - 2, -1), Surface()) for k in range(120)]
    shapes = (
        *beads,
        Solid("/ball", "sphere", np.eye(4), medium=0),
        Solid("/cube", "cube", place(0.5, 1.0), glass, 1, place(0.5, 1.1)),
        Solid("/can", "cylinder", place(0.5, -1.0), medium=2),
        Mesh("/dust", np.add(corners, (0, 0.5, 0)), faces, medium=3),
        Mesh("/more", np.add(corners, (0.2, 0.5, 0)), faces, medium=3),
        Mesh("/paint", corners * 3 - 1, faces, Surface(read, normal=read, clearcoat=0.5), light_links=1),
    )
    lights = (
        AreaLight("/rect", "rect", (0, 3, 0), (1, 0, 0), (0, 0, 1), (9.0,) * 3, image),
        AreaLight("/disk", "disk", (1, 3, 0), (1, 0, 0), (0, 0, 1), (9.0,) * 3, link=0),
        SphereLight("/bulb", (2, 3, 0), 0.2, (9.0,) * 3, shaping=Shaping(DOWN, 0.7, 0.3, 2.0)),
        CylinderLight("/tube", (3, 3, 0), (1, 0, 0), 0.2, (9.0,) * 3),
        MeshLight("/glow", corners[faces] + 4, (9.0,) * 3),
        DistantLight("/sun", DOWN, 0.01, (9.0,) * 3),
        DomeLight("/dome", (1.0, 1.0, 1.0), image),
        DomeLight("/sky", (0.1, 0.1, 0.1)),
    )
    moving = {"f_stop": 1.0, "focus_distance": 4.0, "clipping_range": (4.5, 9.0), "closing": place(1.0, 0.1, 0, 5)}
    return Scene(Camera("/camera", place(1.0, 0, 0, 5), 1.0, 0.6, 0.6, **moving), shapes, media, lights)


def main() -> None:
    """Prints the source tree and the seconds."""
    wp.config.log_level = wp.LOG_WARNING
    wp.init()
    is_full = sys.argv[1] == FULL
    scene = full_scene() if is_full else read_scene(sys.argv[1]).scene
    settings = replace(SETTINGS, aovs=RENDERED_AOVS) if is_full else SETTINGS
    began = sum(os.times()[:4])
    render_image(scene, settings)
    seconds = sum(os.times()[:4]) - began
    print(Path(sys.modules["fgf_warp"].__file__).parents[1], seconds)


if __name__ == "__main__":
    main()

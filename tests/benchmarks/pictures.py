"""The pictures that `same_pictures` compares: one row each, which says what is rendered and what is changed of it."""

from __future__ import annotations

from dataclasses import dataclass, field

PINK = {"hurst": -0.25, "white_noise_scale": 2.0}
FBM = {"hurst": 0.3, "white_noise_scale": 1.0, "outer_scale": 10.0}
EXACT = {"hurst": 0.1, "white_noise_scale": 0.5, "outer_scale": 12.0, "line_variance": "exact"}
TINTED = {"extinction_color": (1.0, 2.0, 3.0)}
ALONE_IN_THE_BALL = ("depth", "transmittance", "albedo", "collisions", "path_length", "optical_depth", "scatterings")
ALONE_IN_THE_ROOM = ("variance", "samples", "normal", "prim_id", "direct", "indirect")
PLANES = frozenset({*ALONE_IN_THE_BALL, *ALONE_IN_THE_ROOM, "instance_id", "motion"})
"""Those that one row each has by itself: all but the denoised radiance."""


@dataclass(frozen=True)
class Picture:
    """What is rendered.

    Args:
        name: of the row.
        scene: a stage of the project with its ending, or one of `picture_scenes`.
        medium: what each of the scene's media has in place of its own.
        settings: in place of `one_tree`'s.
        planes: ``none``, ``usual`` or ``all``, or the name of one.
        by: ``image``, a call for one; ``batch``, a call for images of several media; ``goal``, adaptive sampling; or
            ``threads``, CUDA's driver, run on the CPU.
        goal: of adaptive sampling.
    """

    name: str
    scene: str
    medium: dict[str, object] = field(default_factory=dict)
    settings: dict[str, object] = field(default_factory=dict)
    planes: str = "none"
    by: str = "image"
    goal: dict[str, object] = field(default_factory=dict)


PICTURES = (
    # Stages.
    Picture("sphere", "sphere.usda", planes="usual"),
    Picture("knot", "knot.usda", planes="usual"),
    Picture("cloud block", "cloud_block.usda", planes="usual"),
    Picture("studio", "studio.usda", planes="usual"),
    Picture("glass", "glass.usda", planes="usual"),
    Picture("glass, all planes", "glass.usda", planes="all"),
    # Laws.
    Picture("exponential", "ball"),
    Picture("white noise", "ball", {"hurst": -0.5, "white_noise_scale": 2.5}),
    Picture("fractional", "ball", PINK),
    Picture("fractional, kappa authored", "ball", {"hurst": -0.03, "kappa": 0.4}),
    Picture("negative correlation", "ball", {"hurst": -0.7, "white_noise_scale": 2.0}),
    Picture("power", "ball", FBM),
    Picture("power, H above 1", "ball", {"hurst": 1.6, "white_noise_scale": 0.05, "outer_scale": 4.0}),
    Picture("exact variance", "ball", EXACT),
    Picture("exact variance by the settings, room", "room", FBM, {"line_variance": "exact"}),
    # Transports.
    Picture("fractional, renewal", "ball", PINK, {"transport": "renewal"}),
    Picture("fractional, mixed", "ball", PINK, {"transport": "mixed"}),
    Picture("power, renewal", "ball", FBM, {"transport": "renewal"}),
    Picture("power, mixed, room", "room", FBM, {"transport": "mixed"}),
    Picture("exact variance, mixed", "ball", EXACT, {"transport": "mixed"}),
    # Phase functions.
    Picture("isotropic", "room", {**PINK, "phase_function": "isotropic", "asymmetry": 0.0}),
    Picture("two lobes", "room", {"phase_function": "two_lobe", "back_asymmetry": -0.7, "back_weight": 0.3}),
    Picture("Draine", "room", {"phase_function": "draine", "asymmetry": -0.4, "draine_alpha": 20.0}),
    # Channels that differ, similar media, samplers, bounds.
    Picture("chromatic", "ball", TINTED),
    Picture("chromatic, fractional, mixed, room", "room", {**PINK, **TINTED, "transport": "mixed"}),
    Picture("similarity", "room", {"asymmetry": 0.8}, {"similarity_order": 2}),
    Picture("similarity, fractional", "ball", {**PINK, "asymmetry": 0.8}, {"similarity_order": 4}),
    Picture("independent", "room", PINK, {"sampler": "independent"}),
    Picture("independent, chromatic, nested", "nested", TINTED, {"sampler": "independent"}),
    Picture("four events at most, roulette at once", "room", PINK, {"max_depth": 4, "roulette_depth": 0}),
    Picture("upscaled, not square", "room", PINK, {"width": 50, "height": 37, "upscale": 2}),
    # Shapes and media.
    Picture("cylinder under a sun", "cylinder", PINK),
    Picture("mesh of a medium", "mesh", PINK),
    Picture("no medium", "surfaces"),
    Picture("nested media of three laws, all planes", "nested", planes="all"),
    Picture("touching bodies", "touching"),
    Picture("camera partly in a medium", "inside"),
    Picture("instances in motion, all planes", "instances", planes="all"),
    Picture("instances", "still_instances"),
    Picture("many solids", "many_solids"),
    Picture("motion", "moving", PINK),
    # Surfaces.
    Picture("medium in rough glass, textured floor", "glass"),
    Picture("textures, normals and cut-outs", "textures", planes="usual"),
    # Cameras.
    Picture("lens", "lens"),
    Picture("orthographic", "orthographic"),
    Picture("lens that moves, partly in a medium", "moving_lens", PINK),
    # Lights.
    Picture("lamps that emit evenly", "lamps"),
    Picture("lamps with shapes, cones and images", "dressed_lamps", FBM),
    Picture("dome image", "dome_image", PINK),
    Picture("light links", "links"),
    # Several images in a call, and samples where they help.
    Picture("batch", "room", PINK, by="batch"),
    Picture("batch, exact variance", "ball", EXACT, by="batch"),
    Picture("adaptive", "room", PINK, planes="samples", by="goal", goal={"error": 0.03, "max_spp": 512}),
    Picture("adaptive, 95th percentile", "ball", planes="samples", by="goal", goal={"error": 0.06, "over": "p95"}),
    # Planes.
    Picture("all planes, room", "room", PINK, planes="all"),
    *(Picture(f"{plane} alone, ball", "ball", PINK, planes=plane) for plane in ALONE_IN_THE_BALL),
    *(Picture(f"{plane} alone, room", "room", PINK, planes=plane) for plane in ALONE_IN_THE_ROOM),
    Picture("instance_id alone, instances", "instances", planes="instance_id"),
    Picture("motion alone, lens that moves", "moving_lens", PINK, planes="motion"),
    # The driver of one thread a path.
    Picture("threads, all planes, room", "room", PINK, planes="all", by="threads"),
    Picture(
        "threads, exact variance, chromatic, mixed", "ball", {**EXACT, **TINTED, "transport": "mixed"}, by="threads"
    ),
    Picture("threads, nested media", "nested", planes="usual", by="threads"),
    Picture("threads, instances in motion, all planes", "instances", planes="all", by="threads"),
    Picture("threads, glass", "glass", by="threads"),
    Picture("threads, lens", "moving_lens", PINK, by="threads"),
    Picture("threads, lamps with shapes", "dressed_lamps", FBM, by="threads"),
    Picture(
        "threads, similarity, independent",
        "room",
        PINK,
        {"similarity_order": 2, "sampler": "independent"},
        by="threads",
    ),
)

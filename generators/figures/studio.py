"""The scene that all rendered figures share: the stage ``studio``, whose ball takes one medium after the other."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import groupby

from fgf_warp.scene import Medium, Scene
from fgf_warp.settings import PRESETS, RenderSettings, Sampler
from fgf_warp.theory.kernels import transmittance_ss
from generators.figures.chapter import Shot

STAGE = "studio"
WIDTHS = {"preview": 48, "balanced": 176, "reference": 176}
"""Of each preset's pictures [pixel], square; the blocks of `agreement` divide them."""
BALL_DIAMETER = 2.0
"""[stage unit]."""


def load_studio() -> Scene:
    """The scene, with a ball of the stage's own cloud."""
    from usd_scenes.examples import stage_path  # noqa: PLC0415 - USD is slow to import
    from usd_scenes.reader import read_scene  # noqa: PLC0415

    return read_scene(stage_path(STAGE)).scene


def studio_settings(preset: str, device: str) -> RenderSettings:
    """How every picture is rendered: with independent samples, so that the reported error is that of the picture.

    Args:
        preset: a key of `WIDTHS`.
        device: a Warp device name.
    """
    chosen = PRESETS[preset]
    return RenderSettings(
        width=WIDTHS[preset],
        height=WIDTHS[preset],
        spp=chosen.spp,
        max_depth=chosen.max_depth,
        roulette_depth=chosen.roulette_depth,
        sampler=Sampler.INDEPENDENT,
        device=device,
    )


def shoot(
    scene: Scene,
    media: Sequence[Medium],
    settings: RenderSettings,
    progress: Callable[[float], None] = lambda done: None,
) -> list[Shot]:
    """Renders the ball full of each medium, with successive seeds from the settings' on.

    Args:
        scene: of one medium.
        media: to take its place.
        settings: of every picture.
        progress: called with the number of pictures done, the begun ones by their share.

    Returns:
        One for each medium, in their order.
    """
    from fgf_warp.renderer import Variant, render_batch  # noqa: PLC0415 - starts Warp

    def kind(index: int) -> str:
        return media[index].line_law.kind

    shots: dict[int, Shot] = {}
    for _, batch in groupby(sorted(range(len(media)), key=kind), kind):
        indices, finished = list(batch), len(shots)

        def advance(done: int, total: int, finished: int = finished, count: int = len(indices)) -> None:
            progress(finished + count * done / total)

        variants = [Variant((media[index],), settings.seed + index) for index in indices]
        for index, result in zip(indices, render_batch(scene, variants, settings, advance), strict=True):
            shots[index] = Shot(media[index], result)
    return [shots[index] for index in range(len(media))]


def describe_ball(medium: Medium) -> str:
    """What the pictures of a sheet share, for their caption."""
    depth = BALL_DIAMETER * medium.mean_extinction
    return (
        f"sigma_m = {medium.mean_extinction:g} per unit, so that the ball is {depth:g} mean free paths wide; "
        f"albedo {medium.albedo[0]:g}"
    )


def transmittance_through(medium: Medium) -> float:
    """Of the ray through the middle of the ball.

    Returns:
        In [0, 1], from surface to surface.
    """
    rule = medium.line_law
    return float(transmittance_ss(rule.b, rule.kappa, BALL_DIAMETER * rule.mean_extinction))


def describe_shots(shots: Sequence[Shot]) -> str:
    """How pictures were rendered, for their caption."""
    first, last = shots[0].result, shots[-1].result
    settings = first.settings
    return (
        f"Rendered from usd_scenes/stages/{STAGE}.usda, {settings.width} x {settings.height} pixels, "
        f"{first.samples} samples per pixel, seeds {settings.seed} to {last.settings.seed}, "
        f"{settings.sampler} sampler."
    )

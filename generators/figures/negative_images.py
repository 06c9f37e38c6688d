"""Figure 3: the same scene with negative, no and positive correlation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fgf_warp.scene import Medium
from generators.figures.agreement import GREEN
from generators.figures.chapter import Chapter, Exhibit, Shot
from generators.figures.sheet import picture_sheet
from generators.figures.studio import describe_ball, describe_shots, transmittance_through
from generators.plots import DIVERGING, image_bytes, new_figure, plot_style
from generators.report import Figure

HURSTS = (-0.9, -0.7, -0.5, -0.3, -0.1)
KAPPA = 1.0
ASYMMETRY = 0.0


def media(cloud: Medium) -> list[Medium]:
    """One for each H, all in the renewal transport."""
    ball = replace(cloud, kappa=KAPPA, asymmetry=ASYMMETRY, transport="renewal")
    return [replace(ball, hurst=hurst) for hurst in HURSTS]


def draw(shots: Sequence[Shot]) -> Chapter:
    """The pictures, and how they differ from that of white noise."""
    medium = shots[0].medium
    how = (
        f"kappa = {KAPPA:g}; {describe_ball(medium)}; g = {ASYMMETRY:g}; {medium.resolved_transport} transport. "
        f"{describe_shots(shots)}"
    )
    return Chapter(
        paragraphs=(
            "The same ball with negative correlation (H below -1/2), with none, and with positive correlation (H "
            "above -1/2). kappa is equal, so all laws agree on the transmittance of one mean free path, and all are "
            "rendered with the renewal transport, the only one that negative correlation has: the law alone differs.",
            "Negative correlation lets less light through long segments, so the ball hides the posts and its shadow "
            "is dark; the light that enters is scattered back on the side of the lamp, which is brighter, and less of "
            "it reaches the other side. Positive correlation lets more light through, and does the opposite. Tr is "
            "the transmittance through the middle of the ball.",
        ),
        figures={
            "negative-image": Figure(
                "From negative to positive correlation",
                how,
                picture_sheet(
                    [[shot.result.radiance for shot in shots]],
                    columns=[f"H = {hurst:g}" for hurst in HURSTS],
                    rows=[""],
                    notes=[[_note(shot.medium) for shot in shots]],
                ),
                "png",
            ),
            "negative-difference": Figure(
                "Differences from H = -0.5",
                "Of the green channel, relative to the mean of the picture of white noise: red is brighter than it, "
                "blue darker. " + how,
                _differences(shots),
                "png",
            ),
        },
    )


def _note(medium: Medium) -> str:
    sign = "no correlation" if medium.hurst == -0.5 else "negative" if medium.hurst < -0.5 else "positive"
    return f"{sign}, Tr {transmittance_through(medium):.2g}"


def _differences(shots: Sequence[Shot]) -> bytes:
    images = [shot.result.radiance[..., GREEN].astype(np.float64) for shot in shots]
    white = images[HURSTS.index(-0.5)]
    changes = {hurst: (image - white) / white.mean() for hurst, image in zip(HURSTS, images, strict=True)}
    del changes[-0.5]
    limit = max(float(np.quantile(np.abs(change), 0.995)) for change in changes.values())
    with plot_style():
        figure = new_figure(2.6 * len(changes) + 0.8, 2.9)
        axes = figure.subplots(1, len(changes))
        for axis, (hurst, change) in zip(axes, changes.items(), strict=True):
            drawn = axis.imshow(change, cmap=DIVERGING, vmin=-limit, vmax=limit)
            axis.set_title(f"H = {hurst:g}")
            axis.axis("off")
        figure.colorbar(drawn, ax=axes, shrink=0.85, label="difference / mean")
        return image_bytes(figure, "png")


EXHIBIT = Exhibit("negative-image", "Figure 3: negative against positive correlation", media, draw)

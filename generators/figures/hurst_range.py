"""Figure 1: what H does to the picture, for backward and forward scattering."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from fgf_warp.scene import Medium
from generators.figures.chapter import Chapter, Exhibit, Shot
from generators.figures.sheet import picture_sheet
from generators.figures.studio import describe_ball, describe_shots, transmittance_through
from generators.report import Figure

ASYMMETRIES = (-0.5, 0.5)
KAPPA = 1.0
EQUAL_KAPPA_HURSTS = (-0.5, -0.4, -0.25, -0.1, 0.5)
WHITE_NOISE_SCALE, OUTER_SCALE = 2.5, 10.0
EQUAL_SCALE_HURSTS = (-0.5, -0.4, -0.25, -0.1, 0.25, 0.75)


def media(cloud: Medium) -> list[Medium]:
    """Both sheets, row by row: equal kappa with the exponential before it, then equal S_w."""
    exponential = replace(cloud, hurst=-0.5, kappa=0.0)
    alike = [exponential, *(replace(cloud, hurst=hurst, kappa=KAPPA) for hurst in EQUAL_KAPPA_HURSTS)]
    scaled = [
        replace(cloud, hurst=hurst, kappa=None, white_noise_scale=WHITE_NOISE_SCALE, outer_scale=OUTER_SCALE)
        for hurst in EQUAL_SCALE_HURSTS
    ]
    return [replace(medium, asymmetry=g) for row in (alike, scaled) for g in ASYMMETRIES for medium in row]


def draw(shots: Sequence[Shot]) -> Chapter:
    """Two sheets: equal kappa, and equal S_w."""
    split = len(ASYMMETRIES) * (1 + len(EQUAL_KAPPA_HURSTS))
    alike, scaled = shots[:split], shots[split:]
    fixed = f"{describe_ball(shots[0].medium)}; {shots[0].medium.resolved_transport} transport."
    return Chapter(
        paragraphs=(
            "Rows: Henyey-Greenstein scattering backward (g = -0.5) and forward (g = 0.5), under a lamp that stands "
            "behind the ball to the left. Columns: the Hurst exponent H, from white noise (H = -1/2) over pink noise "
            "to fractional Brownian motion (H > 0).",
            "H says how slowly the fluctuations of the extinction average out along a ray, and so how much more light "
            "gets through long segments than the exponential lets through: y(u) = kappa u^b with b = min(1 + 2H, 1). "
            "To see H alone, kappa is kept equal: then all laws agree on the transmittance of one mean free path, "
            "and differ in what lies behind it. Equal S_w is the other way to hold the rest fixed. But S_w has the "
            "unit length^(-2-2H), which changes with H, so that such a comparison depends on the unit of length, and "
            "kappa differs from column to column. Tr below a picture is the transmittance of the ball's diameter.",
        ),
        figures={
            "hurst-equal-kappa": Figure(
                "H at equal kappa",
                "From left to right the posts behind the ball appear, its shadow fills with light and its edge grows "
                "soft. All fBm of one kappa have the same law, b = 1, so one column stands for them; the first column "
                f"is the classical exponential, kappa = 0. kappa = {KAPPA:g}; {fixed} {describe_shots(alike)}",
                _sheet(alike),
                "png",
            ),
            "hurst-equal-scale": Figure(
                "H at equal S_w",
                f"The same at S_w = {WHITE_NOISE_SCALE:g} unit^(-2-2H), and an outer scale of L = {OUTER_SCALE:g} "
                f"units where H > 0, whose variance is the asymptotic one; {fixed} {describe_shots(scaled)}",
                _sheet(scaled),
                "png",
            ),
        },
    )


def _sheet(shots: Sequence[Shot]) -> bytes:
    count = len(shots) // len(ASYMMETRIES)
    rows = [shots[i * count : (i + 1) * count] for i in range(len(ASYMMETRIES))]
    return picture_sheet(
        [[shot.result.radiance for shot in row] for row in rows],
        columns=[_label(shot.medium) for shot in rows[0]],
        rows=[f"g = {row[0].medium.asymmetry:g}" for row in rows],
        notes=[[_note(shot.medium) for shot in row] for row in rows],
    )


def _label(medium: Medium) -> str:
    regime = medium.line_law.regime
    name = {"exponential": "exponential", "white": "white noise", "pink": "pink noise", "fbm": "fBm"}[regime]
    return name if regime == "exponential" else f"H = {medium.hurst:g}, {name}"


def _note(medium: Medium) -> str:
    return f"kappa {medium.line_law.kappa:.2g}, Tr {transmittance_through(medium):.2g}"


EXHIBIT = Exhibit("hurst", "Figure 1: the Hurst exponent", media, draw)

"""The options of `fgf render`, beside those that commands share: names, ranges, and what their help says."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fgf_warp.settings import DEPTH_MAX, PRESETS, SEED_MAX, SIZE_MAX, SPP_MAX, UPSCALE_MAX, Aov
from fgf_warp.theory.choices import LINE_VARIANCES, TRANSPORTS
from generators.commands.numbers import number, whole_option

Stage = Annotated[Path, typer.Argument(metavar="STAGE", help="The USD file.")]

# ---- what is written

Output = Annotated[
    Path | None,
    typer.Option(
        "--output",
        "-o",
        metavar="OUT.exr",
        help="The image to write; of several frames with #### for their number. "
        "Default: as the stage's RenderProducts say.",
    ),
]
OutputRoot = Annotated[
    Path | None,
    typer.Option(
        "--outputRoot",
        metavar="DIR",
        help="Folder that the stage's productNames are paths from and stay below; default: the working directory.",
    ),
]
Png = Annotated[Path | None, typer.Option(metavar="OUT.png", help="Write an sRGB view too.")]
Planes = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME",
        help=f"Only these planes, repeatable: {', '.join(Aov)}; default: as the stage's RenderVars say, or those "
        "up to prim_id.",
    ),
]
Denoise = Annotated[
    bool,
    typer.Option("--denoise", help="Add the plane denoised, which the PNG then shows; needs the extra denoise."),
]
Explain = Annotated[
    bool, typer.Option("--explain", help="Say what the kernel is built for and why, and render nothing.")
]

# ---- what is read of the stage

Width = Annotated[
    int | None,
    whole_option("--imageWidth", 1, SIZE_MAX, "[pixel]; default: as the stage says, or 960.", short="-w"),
]
Height = Annotated[
    int | None,
    whole_option("--imageHeight", 1, SIZE_MAX, "[pixel]; default: from the aspect ratio."),
]
Complexity = Annotated[
    str, typer.Option("--complexity", "-c", help="Subdivision of surfaces: low, medium, high or veryhigh.")
]
SettingsPath = Annotated[
    str | None,
    typer.Option(
        "--renderSettingsPrimPath",
        "-rs",
        metavar="PATH",
        help="RenderSettings; default: those that the stage names, or the first.",
    ),
]

# ---- how far it is rendered

Spp = Annotated[
    int | None,
    whole_option(
        "--spp",
        1,
        SPP_MAX,
        "Samples per pixel, in place of the preset's; with --targetError or --time the most on average.",
    ),
]
TargetError = Annotated[
    str | None,
    typer.Option(
        "--targetError",
        "--target-error",
        metavar="ERROR",
        help="Render until the relative standard error of the image is this, such as 0.01 or 1%.",
    ),
]
ErrorOver = Annotated[
    str | None,
    typer.Option(
        "--errorOver",
        metavar="HOW",
        help="Over its blocks of 8 x 8 pixels, of which: mean, rms, or a percentile such as p95; default: mean.",
    ),
]
Time = Annotated[
    float | None,
    typer.Option(
        metavar="SECONDS",
        parser=number("--time", "a finite number of seconds > 0", lambda seconds: seconds > 0),
        help="Render so long at most, beside building the kernel and denoising.",
    ),
]
PresetName = Annotated[
    str,
    typer.Option(help=f"{', '.join(PRESETS)}; or the cheapest settings for an error or a time: auto:1%, auto:5s."),
]

# ---- how it is rendered

Seed = Annotated[int, whole_option("--seed", 0, SEED_MAX, "Equal seeds give equal pixels.")]
MaxDepth = Annotated[
    int | None,
    whole_option(
        "--maxDepth",
        1,
        DEPTH_MAX,
        "Scattering events after which a path is cut, in place of the preset's; 1 is single scattering only.",
    ),
]
SimilarityOrder = Annotated[
    int | None,
    whole_option(
        "--similarityOrder",
        1,
        DEPTH_MAX,
        "Scattering events after which a path sees the similar medium that scatters evenly; default: never.",
    ),
]
TransportName = Annotated[
    str | None, typer.Option(help=f"Of all media, in place of their own: {', '.join(TRANSPORTS)}.")
]
LineVarianceName = Annotated[
    str | None,
    typer.Option("--lineVariance", help=f"Of all media, in place of their own: {', '.join(LINE_VARIANCES)}."),
]
Upscale = Annotated[
    int,
    whole_option("--upscale", 1, UPSCALE_MAX, "Render one of so many pixels each way, and enlarge the picture."),
]
SamplerName = Annotated[
    str, typer.Option(help="lattice: less noise than the reported error says; independent: as much as it says.")
]

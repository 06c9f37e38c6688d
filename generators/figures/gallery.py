"""Makes the figures, and a page that holds them all."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from fgf_warp.errors import ConfigError
from fgf_warp.output.atomic import make_folder, write_bytes
from generators.figures import hurst_range, negative_images, negative_law, scale_independence, white_limit
from generators.figures.chapter import Chapter, Exhibit
from generators.figures.studio import WIDTHS, load_studio, shoot, studio_settings
from generators.report import Section, Verdict, write_report

EXHIBITS: dict[str, Exhibit] = {
    module.EXHIBIT.name: module.EXHIBIT
    for module in (hurst_range, negative_law, negative_images, white_limit, scale_independence)
}
PAGE = "index.html"
SEEDS_APART = 1000
"""Between the first seeds of two exhibits, so that no two pictures share one."""
TITLE = "Figures of a fractional Gaussian medium"
LEAD = (
    "What the supplement of Guo et al. 2019, Fractional Gaussian Fields for Modeling and Rendering of "
    "Spatially-Correlated Media, shows in its figures, made anew with a scene of our own. With mean optical depth "
    "u = sigma_m t, the transmittance of every regime is Tr(u) = exp(-u ln(1+y)/y) with y = kappa u^b.",
)

Progress = Callable[[str, float, int], None]
"""Called with the name of the figure under way, the pictures rendered so far, the begun ones by their share, and their
number in all."""


@dataclass(frozen=True)
class Gallery:
    """What was made.

    Args:
        files: the page first, then the figures.
        verdicts: of the figures that claim something.
    """

    files: tuple[Path, ...]
    verdicts: tuple[Verdict, ...]


def write_figures(
    folder: Path,
    *,
    preset: str = "balanced",
    device: str = "cpu",
    only: Sequence[str] = (),
    progress: Progress = lambda name, done, total: None,
) -> Gallery:
    """Writes each figure as a file, and `PAGE` with all of them and what they say.

    Args:
        folder: created where missing; older figures of the same names are replaced.
        preset: preview, balanced or reference: how large the pictures are, and how many samples they have.
        device: a Warp device name.
        only: names of `EXHIBITS`; none makes all.
        progress: see `Progress`.

    Raises:
        ConfigError: for an unknown preset, figure or device.
        OutputError: where a file cannot be written.
    """
    for what, names, accepted in (("preset", (preset,), WIDTHS), ("figure", only, EXHIBITS)):
        unknown = [name for name in names if name not in accepted]
        if unknown:
            raise ConfigError(f"{what} {unknown[0]}: accepted: {', '.join(accepted)}")
    make_folder(folder, [PAGE])
    chapters = _make_chapters([name for name in EXHIBITS if not only or name in only], preset, device, progress)
    files = [folder / PAGE]
    for chapter in chapters.values():
        for stem, figure in chapter.figures.items():
            files.append(folder / f"{stem}.{figure.kind}")
            write_bytes(files[-1], figure.image)
    verdicts = tuple(chapter.verdict for chapter in chapters.values() if chapter.verdict)
    write_report(
        folder / PAGE,
        title=TITLE,
        lead=LEAD,
        sections=[
            Section(EXHIBITS[name].title, chapter.paragraphs, (*chapter.figures.values(), *chapter.tables))
            for name, chapter in chapters.items()
        ],
        verdict=_sum_up(verdicts),
    )
    return Gallery(tuple(files), verdicts)


def _make_chapters(names: Sequence[str], preset: str, device: str, progress: Progress) -> dict[str, Chapter]:
    scene = load_studio()
    settings = studio_settings(preset, device)
    media = {name: EXHIBITS[name].media(scene.media[0]) for name in names}
    total, finished = sum(len(shown) for shown in media.values()), 0
    chapters = {}
    for name in names:
        first = SEEDS_APART * (list(EXHIBITS).index(name) + 1)

        def advance(done: float, name: str = name, finished: int = finished) -> None:
            progress(name, finished + done, total)

        advance(0)
        shots = shoot(scene, media[name], replace(settings, seed=first), advance)
        chapters[name] = EXHIBITS[name].draw(shots)
        finished += len(shots)
    return chapters


def _sum_up(verdicts: Sequence[Verdict]) -> Verdict | None:
    if not verdicts:
        return None
    return Verdict(all(verdict.passed for verdict in verdicts), " ".join(verdict.text for verdict in verdicts))

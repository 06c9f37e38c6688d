"""Which files a render writes: an image for each frame and each product of a stage."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from fgf_warp.errors import ConfigError
from generators.stage import check_stage

if TYPE_CHECKING:
    from usd_scenes.reader import Frame, Product

PLACEHOLDER = re.compile(r"#+(?:\.#+)?")
"""Of a frame's number in the name of a file: ``####``, or ``###.##`` with two decimals."""
NUMBER = r"[-+]?\d{1,15}(?:\.\d{0,15})?"
FRAME_SPEC = re.compile(rf"({NUMBER})(?::({NUMBER})(?:x({NUMBER}))?)?")
"""The first time code, the last, and the stride."""
FRAMES_MAX = 100_000
FRAME_DECIMALS = 9
"""That time codes are rounded to: 0.1 + 2 x 0.1 is 0.3."""


@dataclass(frozen=True)
class Picture:
    """One image to render.

    Args:
        frame: time code, or ``default``; None is the stage's start.
        product: prim path of the RenderProduct; None is the settings' first.
        exr: the file to write.
        png: the view to write beside it, or None.
    """

    frame: Frame | None
    product: str | None
    exr: Path
    png: Path | None = None

    @property
    def files(self) -> list[Path]:
        """Those to write, the EXR first."""
        return [self.exr, *([self.png] if self.png else [])]


def parse_frames(spec: str) -> tuple[float, ...]:
    """The time codes of a list of FrameSpecs, as usdrecord spells them.

    Args:
        spec: FrameSpecs with commas between them, each a time code, or the first and the last with a colon between
            them, and after an ``x`` the stride, which is else 1 towards the last.

    Returns:
        Each of them once, in the order in which they are named.

    Raises:
        ConfigError: for what is no such list, or names more than 100,000 frames.
    """
    found: list[float] = []
    for part in spec.split(","):
        match = FRAME_SPEC.fullmatch(part.strip())
        if match is None:
            raise ConfigError(f"frames {spec}: accepted: frames such as 7, 1:24, 1:24x2 or 101,105:110")
        first = float(match[1])
        last = float(match[2] or first)
        stride = float(match[3] or math.copysign(1, last - first))
        if stride == 0 or (last - first) / stride < 0:
            raise ConfigError(f"frames {spec}: stride {stride:g}; accepted: one that leads from {first:g} to {last:g}")
        count = math.floor((last - first) / stride + 10**-FRAME_DECIMALS) + 1
        if len(found) + count > FRAMES_MAX:
            raise ConfigError(f"frames {spec}: accepted: at most {FRAMES_MAX} frames")
        found.extend(round(first + i * stride, FRAME_DECIMALS) for i in range(count))
    return tuple(dict.fromkeys(found))


def plan_pictures(
    stage: Path,
    frames: Sequence[Frame | None],
    output: Path | None,
    png: Path | None,
    render_settings: str | None,
    root: Path | None = None,
) -> tuple[list[Picture], list[str]]:
    """The images to render, in the order of the frames, and what a user should know of them.

    Args:
        stage: the USD file.
        frames: at least one.
        output: name of the EXR; None takes the productName of each of the stage's products, as a path from `root`.
            With several frames the name holds a placeholder such as ``####``.
        png: name of the view; None writes none.
        render_settings: prim path of the RenderSettings, or None.
        root: folder that productNames lie below, since a stage may come from anyone; None is the working directory.

    Raises:
        ConfigError: for no name, one that does not tell the frames apart, two images of one name, or a productName
            that leads out of `root`.
        SceneError: for a stage that cannot be read.
    """
    if output is not None:
        _check_suffix(output, ".exr")
    if png is not None:
        _check_suffix(png, ".png")
    check_stage(stage)
    from usd_scenes.reader import read_products  # noqa: PLC0415 - USD is slow to import

    pictures: list[Picture] = []
    warnings: list[str] = []
    for frame in frames:
        products = read_products(stage, frame=frame, render_settings=render_settings)
        if output is not None and len(products) > 1:
            others = ", ".join(product.path for product in products[1:])
            warnings = [f"--output names one image, that of {products[0].path}; not rendered: {others}"]
            products = products[:1]
        for product in products:
            exr = output or _product_file(product, root or Path())
            pictures.append(
                Picture(frame, product.path or None, _numbered(exr, frame), _numbered(png, frame) if png else None)
            )
    _check_distinct(file for picture in pictures for file in picture.files)
    return pictures, warnings


def _product_file(product: Product, root: Path) -> Path:
    if not product.file:
        raise ConfigError(
            "--output (-o) is missing; accepted: the name of the EXR, a stage whose RenderProducts have a productName, "
            "or --explain, which writes none"
        )
    path = root / product.file
    if path.suffix.lower() != ".exr":
        raise ConfigError(
            f"{product.path}.productName = {product.file}; accepted: a file name that ends in .exr, or --output"
        )
    if not _place(path).is_relative_to(_place(root / "any").parent):
        raise ConfigError(
            f"{product.path}.productName = {product.file}: leads out of {root.absolute()}; accepted: a path below it, "
            "an --outputRoot that it lies below, or --output"
        )
    return path


def _place(file: Path) -> Path:
    """Where a file is, or would be, by whatever links and dots its folder is named.

    Raises:
        ConfigError: for what is no name of a file.
    """
    try:
        return file.parent.resolve() / file.name
    except (OSError, RuntimeError, ValueError) as error:
        raise ConfigError(f"{file}: is no name of a file: {error}") from error


def _check_suffix(path: Path, suffix: str) -> None:
    if path.suffix.lower() != suffix:
        raise ConfigError(f"{path}: accepted: a file name that ends in {suffix}")


def _numbered(path: Path, frame: Frame | None) -> Path:
    """The name with the frame's number in the place of its placeholder, if it has one."""
    found = list(PLACEHOLDER.finditer(path.name))
    if not found:
        return path
    if len(found) > 1:
        raise ConfigError(f"{path}: accepted: one placeholder of the frame's number, such as ####")
    if not isinstance(frame, int | float):
        raise ConfigError(
            f"{path}: there is no frame whose number it could hold; accepted: --frames, or a name without #"
        )
    whole, _, decimals = found[0].group().partition(".")
    number = f"{frame:0{len(whole) + (len(decimals) + 1 if decimals else 0)}.{len(decimals)}f}"
    if abs(float(number) - frame) > 1e-9 * max(1.0, abs(frame)):
        raise ConfigError(f"{path}: has too few decimals for frame {frame:g}; accepted: a placeholder such as ####.##")
    return path.with_name(path.name[: found[0].start()] + number + path.name[found[0].end() :])


def _check_distinct(files: Iterable[Path]) -> None:
    seen: set[Path] = set()
    for file in files:
        if (place := _place(file)) in seen:
            raise ConfigError(
                f"{file}: is the name of several images; accepted: a placeholder such as #### for the frame's number, "
                "and a name of its own for each product"
            )
        seen.add(place)

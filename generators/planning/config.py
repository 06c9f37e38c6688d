"""The keys of a dataset's config; `generators.planning.document` reads the file."""

from __future__ import annotations

import re
from functools import cached_property
from typing import Annotated, Any, Literal, cast

from pydantic import Field, field_validator, model_validator
from pydantic_core import PydanticCustomError

from fgf_warp.errors import ConfigError
from fgf_warp.result import OVER
from fgf_warp.settings import PRESETS, SEED_MAX, SIZE_MAX, SPP_MAX, Aov, RenderSettings
from generators.dataset.layout import SPLITS
from generators.planning.axes import VALUES_MAX, AxisConfig, GridConfig, Model, Number
from generators.wish import Wish

AovName = Literal[
    "depth",
    "variance",
    "transmittance",
    "albedo",
    "samples",
    "collisions",
    "path_length",
    "normal",
    "prim_id",
    "instance_id",
    "motion",
    "optical_depth",
    "scatterings",
    "direct",
    "indirect",
    "denoised",
]
Share = Annotated[float, Field(ge=0, le=1)]
AUTO_MAX_SPP = 2**16
"""That no sample exceeds whose settings are chosen."""
EXPOSURE_MAX = 32.0
"""[stop], either way: far beyond what a picture needs, and far from where 2^x is no float."""
NAME_BYTES_MAX = 255
"""Of a folder, on the usual file systems."""
LENGTHS_MAX = 10_000
"""Of a curve, which each sample has."""
SHARES_ROUNDING = 1e-9
"""Of the sum of the splits' shares."""


class ImageConfig(Model):
    """Size of the images; what is absent follows from the stage."""

    width: Annotated[int, Field(ge=1, le=SIZE_MAX)] | None = None
    """[pixel], in [1, 65536]."""
    height: Annotated[int, Field(ge=1, le=SIZE_MAX)] | None = None
    """[pixel], in [1, 65536]."""


class QualityConfig(Model):
    """When a sample is good enough, in place of a fixed number of samples per pixel."""

    target_error: Annotated[float, Field(gt=0, lt=1)] | None = None
    """Relative standard error of the image at which a sample is done, in (0, 1)."""
    error_over: str | None = None
    """Over its blocks of 8 x 8 pixels, of which: mean, rms, or a percentile such as p95; the mean where absent."""
    time: Annotated[float, Field(gt=0)] | None = None
    """Wall time of one sample [s], > 0; such a dataset is not the same twice."""
    max_spp: Annotated[int, Field(ge=4, le=SPP_MAX)] = PRESETS["reference"].spp
    """Samples per pixel on average that none exceeds, >= 4, which are needed to tell the error."""

    @model_validator(mode="after")
    def _check_bound(self) -> QualityConfig:
        if self.target_error is None and self.time is None:
            raise PydanticCustomError("quality_bound", "target_error, time, or both")
        if self.error_over is not None and self.target_error is None:
            raise PydanticCustomError("quality_over", "error_over together with target_error, of which it says more")
        if self.error_over is not None and not re.fullmatch(OVER, self.error_over):
            raise PydanticCustomError("quality_over", "error_over: mean, rms, or a percentile from p1 to p99")
        return self


class TargetsConfig(Model):
    """What is computed for each sample beside its image."""

    transmittance: GridConfig | None = None
    """The transmittance of the swept medium along a straight line, at these lengths [unit], >= 0."""
    mean_free_path: bool = False
    """The mean free path of the swept medium [unit]."""

    @model_validator(mode="after")
    def _check_lengths(self) -> TargetsConfig:
        if self.transmittance is not None and self.transmittance.count > LENGTHS_MAX:
            raise PydanticCustomError("target_lengths", f"transmittance: at most {LENGTHS_MAX} lengths")
        if not all(isinstance(length, float) and length >= 0 for length in self.lengths):
            raise PydanticCustomError("target_lengths", "transmittance: lengths >= 0")
        return self

    @cached_property
    def lengths(self) -> tuple[float, ...]:
        """Of the transmittance [unit]; none where it is not asked for."""
        return cast("tuple[float, ...]", self.transmittance.grid_values()) if self.transmittance else ()


class SplitsConfig(Model):
    """Shares of the samples, which add up to 1."""

    train: Share = 0.0
    """In [0, 1]."""
    validation: Share = 0.0
    """In [0, 1]."""
    test: Share = 0.0
    """In [0, 1]."""
    by: list[str] = Field(default_factory=list)
    """Axes: samples that agree in all of them are in one split. Without any, each sample is on its own."""

    @model_validator(mode="after")
    def _check_sum(self) -> SplitsConfig:
        if abs(sum(self.shares.values()) - 1) > SHARES_ROUNDING:
            raise PydanticCustomError("shares", "train, validation and test that add up to 1")
        return self

    @property
    def shares(self) -> dict[str, float]:
        """By split.

        Returns:
            Each in [0, 1]; together 1.
        """
        return {split: getattr(self, split) for split in SPLITS}


CONSTRAINTS_MAX = 100
"""Each of which may be evaluated for each of a million samples."""
ELEVATION_MAX = 89.9
"""[degree], either way: at a pole there is no telling what is up."""


class OrbitConfig(Model):
    """The camera on a sphere, looking at its centre with its own lens; axes of these names take a value's place."""

    center: Annotated[tuple[Number, Number, Number], Field(strict=False)] = (0.0, 0.0, 0.0)
    """What the camera looks at [unit]."""
    azimuth: Number = 0.0
    """Around the up axis [degree]: 0 is in front (at +z, or -y where z is up), 90 on the right (at +x)."""
    elevation: Annotated[Number, Field(ge=-ELEVATION_MAX, le=ELEVATION_MAX)] = 15.0
    """Above the horizon [degree], in (-90, 90)."""
    distance: Annotated[Number, Field(gt=0)] | None = None
    """From the centre [unit], > 0; needed where no axis says it."""


class SweepConfig(Model):
    """A dataset."""

    name: Annotated[str, Field(min_length=1)]
    """Of the dataset, and of its folder where nothing else says, so it is no path."""
    description: str = ""
    """A sentence for its card."""
    license: str = ""
    """SPDX identifier of its license, such as CC-BY-4.0."""
    scene: Annotated[str, Field(min_length=1)] | None = None
    """The USD stage, relative to the config file; an axis of that name takes its place."""
    camera: str | None = None
    """Prim path or name; where absent, the render settings' camera, else the stage's first, with a warning where it has
    several, else a view from the front."""
    orbit: OrbitConfig | None = None
    """Puts the camera on a sphere around a centre."""
    frame: float | None = None
    """Time code; where absent, the stage's startTimeCode, else each attribute's earliest sample."""
    medium: str | None = None
    """Prim path of the material to sweep; needed where the stage has several media."""
    seed: Annotated[int, Field(ge=0, le=SEED_MAX)] = 0
    """Of the dataset, in [0, 2^64); every sample's seed and random values follow from it."""
    image: ImageConfig = ImageConfig()
    """Size of the images."""
    spp: Annotated[int, Field(ge=1, le=SPP_MAX)] | None = None
    """Samples per pixel of every sample, in place of the preset's."""
    quality: QualityConfig | None = None
    """In place of a fixed spp: when a sample is good enough."""
    preset: str = "balanced"
    """How far paths are followed, and the samples per pixel where nothing else says: preview, balanced or reference; or
    auto:1% and the like, which chooses for each sample the cheapest settings that keep this error."""
    aovs: list[AovName] = Field(default_factory=list)
    """Planes to write beside radiance and alpha."""
    png: bool = True
    """Whether to write an 8-bit view of each sample."""
    exposure: Annotated[float, Field(ge=-EXPOSURE_MAX, le=EXPOSURE_MAX)] = 0.0
    """Of these views and the contact sheet [stop], in [-32, 32]."""
    targets: TargetsConfig = TargetsConfig()
    """What is computed for each sample beside its image."""
    transport: Literal["reciprocal", "renewal", "mixed"] | None = None
    """In place of the one that the medium asks for."""
    line_variance: Literal["asymptotic", "exact"] | None = None
    """In place of the one that the medium asks for."""
    axes: dict[str, AxisConfig] = Field(default_factory=dict)
    """What is swept, by column: every combination of the values, the last axis varying fastest."""
    zip: list[Annotated[list[str], Field(min_length=2)]] = Field(default_factory=list)
    """Groups of axes of equally many values that advance together, such as [[H, L]]."""
    draws: Annotated[int, Field(ge=1, le=VALUES_MAX)] = 1
    """Samples per combination, which vary faster than the axes; those of drawn axes have values of their own."""
    design: Literal["random", "latin_hypercube", "sobol"] = "random"
    """How drawn axes fill their ranges together: independently, or evenly over all samples."""
    constraints: Annotated[list[str], Field(max_length=CONSTRAINTS_MAX)] = Field(default_factory=list)
    """Conditions on axes, such as H < 0 or L > 1; samples that break one are left out."""
    splits: SplitsConfig | None = None
    """Shares for training, validation and testing; without them all is for training."""
    output: str | None = None
    """Folder or URL of the dataset; datasets/NAME where absent."""

    @field_validator("name")
    @classmethod
    def _check_name(cls, name: str) -> str:
        is_path = name in (".", "..") or any(part in name for part in ("/", "\\", "::"))
        if is_path or not name.isprintable() or name != name.strip() or len(name.encode()) > NAME_BYTES_MAX:
            accepted = f"the name of a folder: no path, printable, of at most {NAME_BYTES_MAX} bytes"
            raise PydanticCustomError("name", accepted)
        return name

    @field_validator("preset")
    @classmethod
    def _check_preset(cls, preset: str) -> str:
        if preset in PRESETS:
            return preset
        try:
            is_error = Wish.parse(preset).error is not None
        except ConfigError:
            is_error = False
        if not is_error:
            raise PydanticCustomError("preset", f"{', '.join(PRESETS)}, or an error such as auto:1%")
        return preset

    @property
    def wish(self) -> Wish | None:
        """The error for which settings are chosen; None of settings that have a name."""
        return None if self.preset in PRESETS else Wish.parse(self.preset)

    @property
    def bounds(self) -> dict[str, Any]:
        """What bounds each sample's render, see `generators.dataset.plan_table.PlanMeta.quality`."""
        if self.wish is not None:
            return {"spp": AUTO_MAX_SPP, "target_error": self.wish.error, "error_over": "rms"}
        if self.quality is None:
            return {"spp": self.spp or PRESETS[self.preset].spp}
        over = None if self.quality.error_over == "mean" else self.quality.error_over
        asked = {"target_error": self.quality.target_error, "error_over": over, "time": self.quality.time}
        return {"spp": self.quality.max_spp, **{name: value for name, value in asked.items() if value is not None}}

    def render_settings(self, width: int, height: int, device: str) -> RenderSettings:
        """Settings of every sample, with seed 0 in the place of its own.

        Raises:
            ConfigError: for a size that is not accepted.
        """
        preset = PRESETS["balanced" if self.wish else self.preset]
        return RenderSettings(
            width=width,
            height=height,
            spp=int(self.bounds["spp"]),
            max_depth=preset.max_depth,
            roulette_depth=preset.roulette_depth,
            aovs=frozenset(Aov(name) for name in self.aovs),
            device=device,
        )

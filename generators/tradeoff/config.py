"""What `fgf tradeoff` measures: the keys of its config, and the ladder of settings where that names none."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field, model_validator
from pydantic_core import PydanticCustomError
from ruamel.yaml.comments import CommentedMap

from fgf_warp.errors import ConfigError
from fgf_warp.scene import Medium
from fgf_warp.settings import DEPTH_MAX, PRESETS, SPP_MAX, UPSCALE_MAX, Aov, RenderSettings
from fgf_warp.theory.choices import LineVariance, Transport
from generators.planning.axes import Model
from generators.planning.document import Keys, read_document, validate_document
from generators.planning.targets import MEDIUM_FIELDS
from generators.tradeoff.front import BASE
from generators.tradeoff.metrics import REPLICATES_MIN

SIZE_MAX = 1024
"""[pixel]."""
PIXELS_MAX = 2**26
"""Of all images of a rung, which are held at once: 800 MB of each plane."""


class RungConfig(Model):
    """A choice of settings; what is absent is as in the preset ``balanced``."""

    spp: Annotated[int, Field(ge=1, le=SPP_MAX)] | None = None
    """Samples per pixel."""
    sampler: Literal["lattice", "independent"] | None = None
    """Where random numbers come from."""
    max_depth: Annotated[int, Field(ge=1, le=DEPTH_MAX)] | None = None
    """Bound on the number of scattering events; 1 is single scattering."""
    roulette_depth: Annotated[int, Field(ge=0, le=DEPTH_MAX)] | None = None
    """Scattering events before Russian roulette."""
    similarity_order: Annotated[int, Field(ge=1, le=DEPTH_MAX)] | None = None
    """Scattering events before a medium is replaced by the similar one that scatters evenly; left out of pairs where
    all media scatter evenly."""
    transport: Transport | None = None
    """Of the media; left out of pairs where it makes no difference, or cannot be."""
    line_variance: LineVariance | None = None
    """Of fractional Brownian motion; left out of pairs where it makes no difference, or cannot be."""
    upscale: Annotated[int, Field(ge=1, le=UPSCALE_MAX)] | None = None
    """Rendered in one of so many pixels each way, and enlarged."""
    denoise: bool | None = None
    """Whether the layer that the denoiser makes is measured, in the place of the radiance."""

    def overrides(self) -> dict[str, Any]:
        """What it says."""
        return self.model_dump(exclude_none=True)

    def apply(self, settings: RenderSettings) -> RenderSettings:
        """Settings with what it says in their place."""
        said = self.overrides()
        if said.pop("denoise", False):
            said["aovs"] = settings.aovs | {Aov.DENOISED}
        return replace(settings, **said)

    def matters(self, media: Sequence[Medium]) -> bool:
        """Whether the settings that change the model of the media change anything in these."""
        correlated = [medium for medium in media if medium.line_law.kind != "exponential"]
        bounded = [medium for medium in correlated if medium.line_law.regime == "fbm" and medium.hurst < 1]
        by_setting = {
            "similarity_order": any(medium.mean_cosine != 0 for medium in media),
            "transport": any(medium.resolved_transport != self.transport for medium in correlated),
            "line_variance": any(medium.line_variance != self.line_variance for medium in bounded),
        }
        return all(matters for name, matters in by_setting.items() if getattr(self, name) is not None)


class MediumConfig(Model):
    """Parameters of the media of a stage; what is absent is the stage's own. `fgf_warp.scene.Medium` tells ranges."""

    H: float | None = None
    """Hurst exponent."""
    g: float | None = None
    """Henyey-Greenstein asymmetry."""
    S_w: float | None = None
    """White-noise scale [unit^(-2-2H)], in the place of an authored kappa too."""
    sigma_m: float | None = None
    """Mean extinction [1/unit]."""
    L: float | None = None
    """Outer scale [unit]."""
    albedo: Annotated[float, Field(ge=0, le=1)] | None = None
    """Single-scattering albedo of all channels."""
    transport: Transport | None = None
    """How flights depend on where they begin."""
    line_variance: LineVariance | None = None
    """Of fractional Brownian motion."""

    def overrides(self) -> dict[str, Any]:
        """What it says."""
        return self.model_dump(exclude_none=True)

    def apply(self, medium: Medium) -> Medium:
        """A medium with what it says in its place.

        Raises:
            SceneError: where the medium cannot be so.
        """
        said = self.overrides()
        if "albedo" in said:
            said["albedo"] = (said["albedo"],) * 3
        edits: dict[str, Any] = {MEDIUM_FIELDS[name]: value for name, value in said.items()}
        if "S_w" in said:
            edits["kappa"] = None
        return replace(medium, **edits)

    def __str__(self) -> str:
        """``H = -0.25, g = 0.9``; ``as authored`` where it says nothing."""
        return ", ".join(f"{name} = {_shown(value)}" for name, value in self.overrides().items()) or "as authored"


_PREVIEW = {name: value for name, value in asdict(PRESETS["preview"]).items() if value != getattr(PRESETS[BASE], name)}
LADDER: Mapping[str, RungConfig] = {
    "preview": RungConfig(**_PREVIEW),
    "spp 64": RungConfig(spp=64),
    BASE: RungConfig(),
    "spp 256": RungConfig(spp=256),
    "independent sampler": RungConfig(sampler="independent"),
    "single scattering": RungConfig(max_depth=1),
    "depth 4": RungConfig(max_depth=4),
    "depth 16": RungConfig(max_depth=16),
    "depth 64": RungConfig(max_depth=64),
    "roulette 2": RungConfig(roulette_depth=2),
    "roulette 8": RungConfig(roulette_depth=8),
    "roulette 128": RungConfig(roulette_depth=128),
    "similarity 1": RungConfig(similarity_order=1),
    "similarity 4": RungConfig(similarity_order=4),
    "similarity 16": RungConfig(similarity_order=16),
    "upscale 2": RungConfig(upscale=2),
    "upscale 4": RungConfig(upscale=4),
    "denoise": RungConfig(denoise=True),
    "denoise, spp 16": RungConfig(spp=16, denoise=True),
    "renewal": RungConfig(transport="renewal"),
    "reciprocal": RungConfig(transport="reciprocal"),
    "asymptotic variance": RungConfig(line_variance="asymptotic"),
    "exact variance": RungConfig(line_variance="exact"),
}
"""Each knob on its own, beside the presets that are fast enough to be measured."""


class TradeoffConfig(Model):
    """A measurement: every stage with every medium, rendered with every rung of the ladder."""

    stages: Annotated[list[Annotated[str, Field(min_length=1)]], Field(min_length=1)]
    """USD files, relative to the config file, or names of stages that come with the package."""
    media: list[MediumConfig] = Field(default_factory=list)
    """What each stage's media become, one after the other; where absent, variations around the stage's own."""
    size: Annotated[int, Field(ge=1, le=SIZE_MAX)] = 48
    """Of the square images [pixel]."""
    replicates: Annotated[int, Field(ge=REPLICATES_MIN)] = 8
    """Independent images of each rung, >= 4: their spread is the noise."""
    ladder: dict[str, RungConfig] = Field(default_factory=dict)
    """Settings to measure, by name; where absent, each knob on its own."""

    @model_validator(mode="after")
    def _check_pixels(self) -> TradeoffConfig:
        if self.size**2 * self.replicates > PIXELS_MAX:
            raise PydanticCustomError("pixels", f"size^2 times replicates of at most {PIXELS_MAX}, held at once")
        return self

    @property
    def rungs(self) -> Mapping[str, RungConfig]:
        """The ladder, and in any case the rung that all are compared with."""
        return {BASE: RungConfig(), **self.ladder} if self.ladder else LADDER


@dataclass(frozen=True)
class LoadedTradeoff:
    """A config with the file that it came from.

    Args:
        config: as validated.
        path: of the config, or of the only stage.
    """

    config: TradeoffConfig
    path: Path

    def stage_file(self, name: str) -> Path:
        """The file of a stage that the config names.

        Raises:
            ConfigError: where there is none.
        """
        from usd_scenes.examples import stage_names, stage_path  # noqa: PLC0415 - USD is slow to import

        if name in stage_names():
            return stage_path(name)
        file = self.path.parent / name
        if not file.is_file():
            known = ", ".join(stage_names())
            raise ConfigError(f"{self.path}: stages: {name}: there is no such file; accepted: a USD file, or {known}")
        return file


def load_tradeoff(path: Path, overrides: list[str] | None = None) -> LoadedTradeoff:
    """Reads and validates a config; a stage stands for the config that names it and nothing else.

    Args:
        path: a YAML file or a stage.
        overrides: each ``KEY=VALUE``, which take the place of what the file says.

    Raises:
        ConfigError: in one line: file, line and key, what was found, what is accepted.
    """
    is_config = path.suffix.lower() in (".yaml", ".yml")
    document = read_document(path, TradeoffConfig) if is_config else CommentedMap(stages=[path.name])
    config, _ = validate_document(document, path, TradeoffConfig, _model_at, overrides or ())
    if BASE in config.ladder and config.ladder[BASE].overrides():
        raise ConfigError(f"{path}: ladder.{BASE}: is the preset of that name; accepted: another name, or no settings")
    return LoadedTradeoff(config, path)


def variations(medium: Medium) -> list[MediumConfig]:
    """A few media around one, its own first: sparse and dense, another law, another phase function, without absorption.

    Args:
        medium: of a stage.

    Returns:
        What differs from the medium of the stage; its own first, which is empty.
    """
    other_g = 0.0 if abs(medium.asymmetry) >= 0.5 else 0.85
    scale = medium.white_noise_scale or 1.0
    laws = [MediumConfig(H=hurst, S_w=scale) for hurst in (-0.5, -0.25) if abs(hurst - medium.hurst) > 0.1]
    return [
        MediumConfig(),
        MediumConfig(sigma_m=medium.mean_extinction / 4),
        MediumConfig(sigma_m=medium.mean_extinction * 4),
        *laws,
        *([MediumConfig(g=other_g)] if medium.phase_function != "isotropic" else []),
    ]


def _model_at(keys: Keys) -> type[BaseModel]:
    if len(keys) == 2:
        return MediumConfig if keys[0] == "media" else RungConfig
    return TradeoffConfig


def _shown(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float | int) else str(value)

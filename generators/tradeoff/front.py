"""What `fgf tradeoff` has measured, as it is written to a file and read again."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

from fgf_warp.errors import ConfigError
from fgf_warp.output.atomic import write_bytes

BASE = "balanced"
"""The rung that the others' settings and efficiencies are relative to: the default preset."""
UNBIASED_SETTINGS = frozenset({"spp", "sampler", "roulette_depth"})
"""Settings that change the noise and the time of an image, and not its expectation."""


@dataclass(frozen=True)
class Rung:
    """One choice of settings, measured on one pair. Errors are relative, by blocks of 8 x 8 pixels.

    Args:
        name: of the rung, the same in all pairs.
        settings: what differs from `BASE`, by the names of `RenderSettings`; and ``denoise``, true where the layer
            that the denoiser makes was measured in the place of the radiance.
        spp: samples per pixel.
        seconds: CPU time of one image, of all threads together and beyond `Pair.start_seconds` [s]; on a device other
            than the CPU, wall time.
        rmse: root of the mean squared error, in units of radiance.
        relative_mse: mean over blocks of the squared error over the squared mean of the block.
        relative_rmse: its root; ``relative_rmse^2 = noise^2 + bias_rms^2``.
        bias: signed mean over blocks of the mean difference from the reference over the mean of the block.
        bias_low: lower end of its 95 % confidence interval.
        bias_high: upper end.
        bias_rms: root of the mean squared bias, pixel by pixel, with the noise taken out; 0 where none is seen.
        bias_rms_high: upper end of its 95 % confidence interval.
        noise: root of the mean squared relative standard error.
        flip: mean FLIP of the displayed pictures, in [0, 1].
        delta_e: mean CIE 2000 colour difference of the displayed pictures.
        efficiency: 1 / (relative_mse x seconds), over that of `BASE`; None where one of the two has no
            error at all.
        pareto: whether no other rung of the pair has both less error and less time.
    """

    name: str
    settings: Mapping[str, int | str | bool]
    spp: int
    seconds: float
    rmse: float
    relative_mse: float
    relative_rmse: float
    bias: float
    bias_low: float
    bias_high: float
    bias_rms: float
    bias_rms_high: float
    noise: float
    flip: float
    delta_e: float
    efficiency: float | None
    pareto: bool

    @property
    def is_unbiased(self) -> bool:
        """Whether it has the expectation of `BASE` by construction, whatever was measured."""
        return set(self.settings) <= UNBIASED_SETTINGS

    def spp_for(self, target: float) -> float | None:
        """Samples per pixel with which noise and bias together are `target`; None where the bias alone exceeds it.

        What a denoiser leaves of the noise follows no such law: its number is what was measured, if that is enough.

        Args:
            target: root of the mean squared relative error, > 0.

        Returns:
            > 0; need not be an integer.
        """
        if self.settings.get("denoise"):
            return self.spp if self.relative_rmse <= target else None
        bias = 0.0 if self.is_unbiased else self.bias_rms
        return self.spp * self.noise**2 / (target**2 - bias**2) if bias < target else None

    def seconds_for(self, target: float) -> float | None:
        """CPU time of an image of that error and the measured size [s]; None as for `spp_for`."""
        spp = self.spp_for(target)
        return None if spp is None else self.seconds * spp / self.spp


@dataclass(frozen=True)
class Reference:
    """What the rungs of a pair were compared with.

    Args:
        spp: samples per pixel.
        relative_standard_error: root of the mean squared relative standard error, by blocks as the rungs' noise.
        seconds: CPU time that it took [s], when it was rendered.
    """

    spp: int
    relative_standard_error: float
    seconds: float


@dataclass(frozen=True)
class Pair:
    """A stage with a medium, and how each rung did on it.

    Args:
        name: of the pair, unique.
        stage: file or name of the stage.
        medium: parameters of its medium by their short names; empty where the stage has none.
        features: what tells which pair is like another: ``optical_depth``, ``scatterings``, ``regime``, ``H``, ...
        start_seconds: time that any render of the scene takes before its first sample, whatever its settings [s].
        reference: what the rungs were compared with.
        rungs: in the ladder's order; one of them is `BASE`.
    """

    name: str
    stage: str
    medium: Mapping[str, Any]
    features: Mapping[str, Any]
    start_seconds: float
    reference: Reference
    rungs: tuple[Rung, ...]

    def rung(self, name: str) -> Rung:
        """The rung of this name.

        Raises:
            KeyError: where the pair has none.
        """
        for rung in self.rungs:
            if rung.name == name:
                return rung
        raise KeyError(name)


@dataclass(frozen=True)
class Front:
    """A whole measurement.

    Args:
        versions: of the software that it was made with.
        machine: that it was made on.
        pixels: of each image, along a side; the images are square.
        replicates: independent images of each rung.
        pairs: in the config's order.
    """

    versions: Mapping[str, str]
    machine: str
    pixels: int
    replicates: int
    pairs: tuple[Pair, ...]


def read_front(path: Path | None = None) -> Front:
    """Reads what was measured.

    Args:
        path: of a ``tradeoff.json``; None takes the one that comes with the package, of configs/tradeoff.yaml.

    Raises:
        ConfigError: where it cannot be read, or is no such file.
    """
    source = files(__package__).joinpath("front.json") if path is None else path
    try:
        found = json.loads(source.read_text(encoding="utf-8"))
        pairs = tuple(
            Pair(
                **{
                    **pair,
                    "reference": Reference(**pair["reference"]),
                    "rungs": tuple(Rung(**rung) for rung in pair["rungs"]),
                }
            )
            for pair in found["pairs"]
        )
        return Front(**{**found, "pairs": pairs})
    except OSError as error:
        raise ConfigError(f"{source}: cannot be read: {error.strerror}") from error
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise ConfigError(f"{source}: is no measurement of `fgf tradeoff` that this version reads: {error}") from error


def write_front(path: Path, front: Front) -> None:
    """Writes it, whole or not at all.

    Raises:
        OutputError: where it cannot be written.
    """
    write_bytes(path, (json.dumps(asdict(front), indent=1, allow_nan=False) + "\n").encode())

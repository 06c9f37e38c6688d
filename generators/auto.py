"""The settings that reach an error, or make the most of a time, at the least cost: chosen from what was measured.

`fgf tradeoff` has measured, on many media, what each rung of a ladder of settings costs in time, noise and bias. The
media nearest to those of a scene tell which rungs may suit it; a pilot, a small and short render, tells what they are
worth here: it follows the same paths with the chosen settings and with the default ones, whose difference is the bias.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from statistics import geometric_mean
from typing import Any

import numpy as np

from fgf_warp.convergence import Goal
from fgf_warp.finishing import as_rendered
from fgf_warp.renderer import prepare, render
from fgf_warp.result import DARK, RenderResult, block_means, block_sizes
from fgf_warp.scene import Scene
from fgf_warp.settings import RenderSettings
from generators.tradeoff.features import FEATURE_AOVS, read_features
from generators.tradeoff.front import BASE, UNBIASED_SETTINGS, Front, Pair
from generators.wish import Wish

CHOSEN = frozenset({"roulette_depth", "max_depth", "similarity_order", "upscale"})
"""Settings that may be chosen. Samples per pixel follow from the goal, and the transport of media is the author's."""
MOST_BIAS = 0.5
"""Of the error that is asked for."""
LEAST_GAIN = 1.1
"""In efficiency, for which the default settings are left: measured times are no more exact than that."""
NEIGHBOURS = 3
"""Measured pairs, at most, of whose biases the largest counts."""
FAR = 3.0
"""Distance beyond which a pair tells nothing of a scene."""
UNIT_H, UNIT_G, UNIT_DEPTH, UNIT_ABSORPTION, UNIT_SCATTERINGS = 0.25, 0.4, math.log(3), math.log(4), math.log(3)
"""Differences that count as a distance of 1."""
LEAST_ABSORPTION = 0.005
"""Share of light that collisions absorb, below which it makes no difference."""
PILOT_SIZE = 48
"""[pixel] of the longer side of a pilot's images, which is what `fgf tradeoff` measures with."""
PILOT_SPP = 32
"""Samples per pixel of a pilot."""
PILOT_SEED = 0x5EED
"""Of the pilot, whatever the seed of the image: the choice does not depend on that."""
LEAST_DEPTH = 0.01
"""Optical depth below which it makes no difference."""
LEAST_LEFT = 0.05
"""Share of a time that is left to the image, however long the pilot took."""


@dataclass(frozen=True)
class Choice:
    """How to render, and why so.

    Args:
        rung: name of the settings.
        settings: of the image.
        goal: when to stop.
        lines: what was chosen and why, as sentences for a person.
        seconds: wall time that choosing took, without building kernels.
    """

    rung: str
    settings: RenderSettings
    goal: Goal
    lines: tuple[str, ...]
    seconds: float


@dataclass(frozen=True)
class Candidate:
    """Settings that may suit a scene.

    Args:
        rung: their name.
        settings: what differs from `BASE`, samples per pixel apart.
        bias: relative, by blocks, at most.
        gain: noise^2 x time of `BASE`, over that of the candidate.
    """

    rung: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    bias: float = 0.0
    gain: float = 1.0

    @property
    def is_unbiased(self) -> bool:
        """Whether it converges to what `BASE` does."""
        return set(self.settings) <= UNBIASED_SETTINGS


def nearest(front: Front, features: Mapping[str, Any]) -> list[Pair]:
    """The measured pairs that a scene is like, the nearest first; none where it is far from all of them.

    Args:
        front: what was measured.
        features: of the scene, see `generators.tradeoff.features`.

    Returns:
        At most `NEIGHBOURS`, of the same regime of the law, and none farther away than `FAR`.
    """
    if "regime" not in features:
        return []
    alike = [pair for pair in front.pairs if pair.features.get("regime") == features["regime"]]
    alike.sort(key=lambda pair: distance(pair.features, features))
    return [pair for pair in alike[:NEIGHBOURS] if distance(pair.features, features) <= FAR]


def distance(one: Mapping[str, Any], other: Mapping[str, Any]) -> float:
    """How far apart two scenes are in their features.

    Args:
        one: see `generators.tradeoff.features`; with a regime.
        other: likewise.

    Returns:
        >= 0; a difference of 0.25 in H alone is 1, and so are those of the other features beside `UNIT_H`.
    """
    return math.dist(_place(one), _place(other))


def _place(features: Mapping[str, Any]) -> tuple[float, ...]:
    return (
        features["H"] / UNIT_H,
        features["g"] / UNIT_G,
        math.log(max(features["optical_depth"], LEAST_DEPTH)) / UNIT_DEPTH,
        math.log(max(1 - features["albedo"], LEAST_ABSORPTION)) / UNIT_ABSORPTION,
        math.log1p(features["scatterings"]) / UNIT_SCATTERINGS,
    )


def list_candidates(pairs: Sequence[Pair], allowed: frozenset[str]) -> list[Candidate]:
    """The rungs that were measured on all of some pairs, `BASE` first.

    Args:
        pairs: whose largest bias and mean gain count.
        allowed: settings that may be chosen.
    """
    candidates = [Candidate(BASE)]
    shared = set.intersection(*({rung.name for rung in pair.rungs} for pair in pairs)) if pairs else set()
    for name in (rung.name for rung in pairs[0].rungs if rung.name in shared) if pairs else ():
        rungs, bases = [pair.rung(name) for pair in pairs], [pair.rung(BASE) for pair in pairs]
        settings = {key: value for key, value in rungs[0].settings.items() if key != "spp"}
        costs = [rung.noise**2 * rung.seconds for rung in rungs]
        if not settings or not set(settings) <= allowed or not all(costs):
            continue
        candidates.append(
            Candidate(
                name,
                settings,
                bias=0.0 if rungs[0].is_unbiased else max(rung.bias_rms_high for rung in rungs),
                gain=geometric_mean(
                    [base.noise**2 * base.seconds / cost for base, cost in zip(bases, costs, strict=True)]
                ),
            )
        )
    return candidates


def pick(candidates: Sequence[Candidate], wish: Wish, noise: float) -> Candidate:
    """The best of them; `BASE`, which is the first, or another without bias, where no other is clearly better.

    Args:
        candidates: of `list_candidates`.
        wish: what to reach.
        noise: relative error that `BASE` has at the end of the time; of no meaning to an error.
    """

    def cost(candidate: Candidate) -> float:
        if wish.error is None:
            return candidate.bias**2 + noise**2 / candidate.gain
        if candidate.bias > MOST_BIAS * wish.error:
            return math.inf
        return 1 / (candidate.gain * (wish.error**2 - candidate.bias**2))

    chosen = candidates[0]
    # A bias must be worth it beside the best without one.
    for better in (min((one for one in candidates if one.is_unbiased), key=cost), min(candidates, key=cost)):
        if LEAST_GAIN * cost(better) <= cost(chosen):
            chosen = better
    return chosen


def choose(scene: Scene, settings: RenderSettings, wish: Wish, front: Front) -> Choice:
    """Chooses the settings for a scene; builds the kernels that its render needs.

    Args:
        scene: to render.
        settings: of the image, with the depths of `BASE`.
        wish: what to reach.
        front: what was measured.

    Raises:
        ConfigError: for a device that is not there, or where the memory does not hold the image.
        UnsupportedFeatureError: for a scene that this version cannot render.
        NumericalError: where a sample was not finite.
    """
    rendered, _ = as_rendered(scene, settings)
    pilot = _Pilot(rendered, replace(settings, transport=None, line_variance=None))
    near = nearest(front, pilot.features)
    candidates = list_candidates(near, _allowed(rendered, wish))
    noise = 0.0 if wish.time is None else pilot.noise_after(wish.time)
    dropped: list[Candidate] = []
    while not (best := pick(candidates, wish, noise)).is_unbiased and "upscale" not in best.settings:
        seen = replace(best, bias=max(best.bias, pilot.bias_of(best)))
        candidates = [seen if candidate is best else candidate for candidate in candidates]
        if pick(candidates, wish, noise) is seen:
            best = seen
            break
        dropped.append(seen)
    chosen = replace(settings, **best.settings)
    prepare(*as_rendered(scene, chosen))
    if wish.time is None:
        assert wish.error is not None
        goal = Goal(error=math.sqrt(wish.error**2 - best.bias**2), over="rms")
        outlook = f"about {pilot.seconds_for(goal.error or 0.0) / best.gain:.2g} s expected"
    else:
        goal = Goal(time=max(wish.time - pilot.spent - pilot.start, LEAST_LEFT * wish.time))
        outlook = f"an error of about {100 * math.sqrt(best.bias**2 + noise**2 / best.gain):.2g} % expected"
    lines = (
        f"{wish.text}: {_reason(best, near, scene)}",
        *(
            f"{candidate.rung} would be {candidate.gain:.2g} times as efficient, but its bias here is "
            f"{100 * candidate.bias:.2g} %"
            for candidate in dropped
            if candidate.rung != best.rung
        ),
        f"pilot: {_seen(pilot.features)}{outlook}",
    )
    return Choice(best.rung, chosen, goal, lines, pilot.spent)


def _allowed(scene: Scene, wish: Wish) -> frozenset[str]:
    allowed = CHOSEN
    if wish.time is None:
        # A small picture enlarged is to look at.
        allowed -= {"upscale"}
    if any(law.kind == "exact_fbm" for medium in scene.media for law in medium.channel_laws):
        allowed -= {"similarity_order"}
    return allowed


def _reason(best: Candidate, near: Sequence[Pair], scene: Scene) -> str:
    if not near:
        why = "nothing like it was measured" if scene.media else "there is no medium in the scene"
        return f"{BASE}, since {why}"
    names = f"on {near[0].name}" + (f" and {len(near) - 1} more alike" if len(near) > 1 else "")
    if not best.settings:
        return f"{BASE}, since nothing that keeps this was measured to be clearly more efficient {names}"
    changes = ", ".join(f"{name} {value}" for name, value in best.settings.items())
    bias = "without bias" if best.is_unbiased else f"with a bias of at most {100 * best.bias:.2g} %"
    loud = "; the picture is RENDERED SMALL AND ENLARGED" if "upscale" in best.settings else ""
    return f"{BASE} with {changes}: {best.gain:.2g} times as efficient as {BASE}, {bias}, as measured {names}{loud}"


def _seen(features: Mapping[str, Any]) -> str:
    if "regime" not in features:
        return ""
    return f"optical depth {features['optical_depth']:.2g}, {features['scatterings']:.2g} scattering events a path, "


class _Pilot:
    """Small and short renders of a scene.

    Args:
        scene: to render.
        settings: of the image, with the depths of `BASE`.
    """

    def __init__(self, scene: Scene, settings: RenderSettings) -> None:
        self._scene, self._pixels = scene, settings.width * settings.height
        scale = min(1.0, PILOT_SIZE / max(settings.width, settings.height))
        self._settings = replace(
            settings,
            width=math.ceil(scale * settings.width),
            height=math.ceil(scale * settings.height),
            spp=PILOT_SPP,
            seed=PILOT_SEED,
            aovs=FEATURE_AOVS,
        )
        self.spent = 0.0
        """Wall time of its renders [s]."""
        self._result = self._render(self._settings)
        self.start = self.spent - self._result.seconds
        """Wall time that a render takes before its first sample [s]."""
        self.features = read_features(scene, self._result)

    def bias_of(self, candidate: Candidate) -> float:
        """Of the paths that both have alike, by blocks, with the noise taken out."""
        other = self._render(replace(self._settings, **candidate.settings))
        return paired_bias(self._result.radiance, other.radiance)

    def noise_after(self, seconds: float) -> float:
        """Root of the mean squared relative error of the image after so long a render."""
        spp = max(seconds / (self._seconds_per_path * self._pixels), 1.0)
        return self._result.relative_error("rms") * math.sqrt(PILOT_SPP / spp)

    def seconds_for(self, error: float) -> float:
        """What the image takes to have so large an error."""
        spp = PILOT_SPP * (self._result.relative_error("rms") / error) ** 2
        return spp * self._pixels * self._seconds_per_path

    @property
    def _seconds_per_path(self) -> float:
        return self._result.seconds / self._result.path_count

    def _render(self, settings: RenderSettings) -> RenderResult:
        scene, asked = as_rendered(self._scene, settings)
        prepare(scene, asked)
        began = time.perf_counter()
        result = render(scene, asked)
        self.spent += time.perf_counter() - began
        return result


def paired_bias(radiance: np.ndarray, other: np.ndarray) -> float:
    """Root of the mean squared relative difference of the blocks of two images of the same paths.

    Args:
        radiance: (height, width, 3), of blocks that it is relative to.
        other: the same of other settings.

    Returns:
        Without what the scatter of pixels in a block adds to it; 0 where nothing else is seen.
    """
    difference = (other - radiance).mean(axis=2)[..., None]
    means, mean = block_means(radiance), block_means(difference)
    sizes = block_sizes(radiance.shape[:2])
    scatter = (block_means(difference**2) - mean**2) / np.maximum(sizes - 1, 1)
    bright = np.maximum(means, DARK * radiance.mean(dtype=np.float64))
    squares = (mean**2 - scatter) / np.where(bright > 0, bright, 1.0) ** 2
    return math.sqrt(max(float(np.average(squares, weights=sizes)), 0.0))

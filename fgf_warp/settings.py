"""How a scene is rendered: everything that trades speed for accuracy, and nothing else."""

from __future__ import annotations

from collections.abc import Set
from dataclasses import dataclass
from enum import StrEnum

from fgf_warp.errors import ConfigError
from fgf_warp.theory.choices import LINE_VARIANCES, TRANSPORTS, LineVariance, Transport

SEED_MAX = 2**64 - 1
SIZE_MAX = 2**16
"""[pixel], of each side."""
SPP_MAX = 2**31 - 1
DEPTH_MAX = 2**24
"""Scattering events."""
UPSCALE_MAX = 8
"""Beyond it a picture is made of so few pixels that it shows little of the scene."""
GIB = 2**30
"""Bytes of a GiB."""
MEMORY_MAX = 2**20
"""[GiB]."""


class Sampler(StrEnum):
    """Where the random numbers of a pixel's samples come from."""

    LATTICE = "lattice"
    """At each event the samples share a shuffled, randomly shifted lattice, which lowers the variance of a pixel by a
    factor of 1.2 to 1.9. The error that a render of a fixed number of samples reports knows nothing of it, so it is too
    large by that much; one to a goal knows it."""
    INDEPENDENT = "independent"
    """Every number is independent of all others, and the reported error is that of the image."""


class Aov(StrEnum):
    """Arbitrary output variables beside radiance and alpha."""

    DEPTH = "depth"
    """Camera-space depth of the nearest surface or medium boundary in the pixel [stage unit]; inf where none is."""
    VARIANCE = "variance"
    """Variance of each channel's pixel mean, that is, its squared standard error."""
    TRANSMITTANCE = "transmittance"
    """Tr of the first medium segment along the camera ray, per channel; 1 where there is none."""
    ALBEDO = "albedo"
    """Diffuse reflectance or single-scattering albedo where the path first interacts; 0 where it never does."""
    SAMPLES = "samples"
    """Number of samples in the pixel."""
    COLLISIONS = "collisions"
    """Mean number of collisions in media of a particle that takes the camera's place, per channel: each of them absorbs
    it with probability 1 - albedo, and the one that does is counted. Estimated by the path's throughput, and where
    channels differ in extinction its weight, before each collision; that is the plain count where albedo is 1."""
    PATH_LENGTH = "path_length"
    """Mean length that the same particle travels in media, per channel [stage unit]; weighted alike."""
    NORMAL = "normal"
    """Mean unit normal, in world space and to the side that is seen, of the surface that the path meets first; a path
    that scatters in a medium before, or meets none, counts as 0."""
    PRIM_ID = "prim_id"
    """Number of the prim nearest in the pixel, whose surface a path meets or in whose medium it scatters first: its
    place, from 1 on, among the names in the header; 0 where there is none, and of lights."""
    INSTANCE_ID = "instance_id"
    """Number of that prim in its instancer; -1 where it is in none."""
    MOTION = "motion"
    """Mean displacement in the image of what is seen first, from the opening of the shutter to its closing, to the
    right and down [pixel]; 0 where nothing is seen."""
    OPTICAL_DEPTH = "optical_depth"
    """sigma_m times the length of the first medium segment along the camera ray, per channel; 0 where there is none."""
    SCATTERINGS = "scatterings"
    """Mean number of scattering events of a path, at surfaces and in media, as it is traced: to its end by roulette."""
    DIRECT = "direct"
    """The radiance of light that is seen at once or after one scattering event, at a surface or in a medium."""
    INDIRECT = "indirect"
    """The rest of the radiance."""
    DENOISED = "denoised"
    """The radiance without its noise, by Intel Open Image Denoise, guided by albedo and normal: to look at, and biased.
    The radiance itself stays as it is. On cloud_block a relative RMSE of 7.9 % at 16 samples becomes 1.7 %, 2.7 % at
    128 becomes 1.2 %, and 1.3 % at 1024 becomes 1.0 %, in 9 seconds of one core a megapixel. Made by
    `finishing.finish`."""


RENDERED_AOVS = frozenset(Aov) - {Aov.DENOISED}
"""The planes that the renderer makes by itself."""
TRACED_AOVS = RENDERED_AOVS - {Aov.VARIANCE, Aov.SAMPLES}
"""The planes that a kernel must be built for; the others follow from its sums."""
SPLIT_AOVS = frozenset({Aov.DIRECT, Aov.INDIRECT})
"""The two parts of the radiance; a render sums one and has both."""
PRIM_AOVS = frozenset({Aov.PRIM_ID, Aov.INSTANCE_ID, Aov.MOTION})
"""Planes that tell what is seen first."""
USUAL_AOVS = RENDERED_AOVS - SPLIT_AOVS - {Aov.INSTANCE_ID, Aov.MOTION, Aov.OPTICAL_DEPTH, Aov.SCATTERINGS}
"""What a single image is written with unless others are named."""


@dataclass(frozen=True)
class RenderSettings:
    """What to compute and how far.

    Args:
        width: [pixel], >= 1.
        height: [pixel], >= 1.
        spp: samples per pixel, >= 1.
        seed: in [0, 2^64); equal seeds give equal pixels on one device.
        max_depth: bound on the number of scattering events of a path, >= 1. Paths that reach it are cut,
            counted and reported. 1 is single scattering only: 1.8 times as fast and 14 % too dark on sphere, 1.4 times
            and 22 % on cloud_block. 64 is as fast as 1024, and up to 0.6 % too dark.
        roulette_depth: number of scattering events after which Russian roulette may end a path, >= 0. It never biases.
            8 is 0.8 times as efficient as 32 (noise^2 x time; 0.4 to 1.2), 2 is 0.56 times, and 128 is 1.3 times (0.74
            where albedo is 0.5, 9 where it is 0.98 and optical depth 25).
        similarity_order: number of scattering events, >= 1, after which a path's medium is replaced by the one that
            scatters evenly, with (1 - g) times the scattering (`theory.similarity`); None is never. 4 is 2.6 times as
            efficient (0.8 to 11), with a relative RMSE of 0.8 % on the median and 10 % with g = 0.99 under a lamp that
            no sample removes; 16 is 1.7 times (0.8 to 4.5), with 0.1 % and 4 %.
        aovs: what to write beside radiance and alpha; a set, of `Aov` or their names.
        sampler: where random numbers come from, a `Sampler` or its name.
        transport: of all media, ``reciprocal``, ``renewal`` or ``mixed``, in place of their own; None keeps those. On
            sphere, renewal takes 0.9 times as long as reciprocal and is 1.4 % brighter, mixed twice as long and 0.5 %.
        line_variance: of all media, ``asymptotic`` or ``exact``, in place of their own; None keeps those. With H from
            0.1 to 0.5 on sphere, exact takes 1.5 to 2.5 times as long; of L = 20 its mean is less by 0.1 % at most.
        upscale: in [1, 8]; the picture is rendered in one of so many pixels each way, and enlarged. On cloud_block,
            128 pixels wide, 2 is 3.9 times as fast and 4 is 14 times, with a relative RMSE of 3.6 % and 6.4 % that no
            sample removes. In the time of 16 samples without, it is 4.2 % and 6.4 % instead of 7.9 %.
        device: a Warp device name, ``cpu`` or ``cuda:0``.
        threads: CPU threads of one render, >= 1; None takes every core. It never changes a pixel.
        memory: that the images which are rendered at once may take, beside the scene [GiB], in (0, 2^20]. It never
            changes a pixel.

    Raises:
        ConfigError: naming the setting, its value and the accepted range.
    """

    width: int = 512
    height: int = 512
    spp: int = 128
    seed: int = 0
    max_depth: int = 1024
    roulette_depth: int = 32
    similarity_order: int | None = None
    aovs: frozenset[Aov] = frozenset()
    sampler: Sampler = Sampler.LATTICE
    transport: Transport | None = None
    line_variance: LineVariance | None = None
    upscale: int = 1
    device: str = "cpu"
    threads: int | None = None
    memory: float = 4.0

    def __post_init__(self) -> None:
        for key, lower, upper in (
            ("width", 1, SIZE_MAX),
            ("height", 1, SIZE_MAX),
            ("spp", 1, SPP_MAX),
            ("seed", 0, SEED_MAX),
            ("max_depth", 1, DEPTH_MAX),
            ("roulette_depth", 0, DEPTH_MAX),
            ("upscale", 1, UPSCALE_MAX),
        ):
            value = getattr(self, key)
            if not _is_integer(value) or not lower <= value <= upper:
                raise ConfigError(f"{key} = {value!r}; accepted: an integer in [{lower}, {upper}]")
        order = self.similarity_order
        if order is not None and (not _is_integer(order) or not 1 <= order <= DEPTH_MAX):
            raise ConfigError(f"similarity_order = {order!r}; accepted: an integer in [1, {DEPTH_MAX}], or None")
        if self.threads is not None and (not _is_integer(self.threads) or self.threads < 1):
            raise ConfigError(f"threads = {self.threads!r}; accepted: an integer >= 1, or None")
        is_number = isinstance(self.memory, int | float) and not isinstance(self.memory, bool)
        if not is_number or not 0 < self.memory <= MEMORY_MAX:
            raise ConfigError(f"memory = {self.memory!r}; accepted: a number of GiB > 0, at most {MEMORY_MAX}")
        if not isinstance(self.device, str):
            raise ConfigError(f"device = {self.device!r}; accepted: a name, such as 'cpu'")
        if self.sampler not in set(Sampler):
            raise ConfigError(f"sampler = {self.sampler!r}; accepted: {', '.join(Sampler)}")
        for key, names in (("transport", TRANSPORTS), ("line_variance", LINE_VARIANCES)):
            if getattr(self, key) not in (None, *names):
                raise ConfigError(f"{key} = {getattr(self, key)!r}; accepted: {', '.join(names)}, or None")
        if not isinstance(self.aovs, Set) or not self.aovs <= set(Aov):
            raise ConfigError(f"aovs = {self.aovs!r}; accepted: a set of {', '.join(Aov)}")
        # Of the type, and hashable, whatever was given.
        object.__setattr__(self, "sampler", Sampler(self.sampler))
        object.__setattr__(self, "aovs", frozenset(Aov(name) for name in self.aovs))


def _is_integer(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)


@dataclass(frozen=True)
class Preset:
    """A named point on the trade of speed for accuracy, chosen from what `fgf tradeoff` measured.

    Args:
        spp: samples per pixel.
        max_depth: bound on the number of scattering events.
        roulette_depth: events before Russian roulette starts.
    """

    spp: int
    max_depth: int
    roulette_depth: int


PREVIEW = Preset(spp=16, max_depth=1024, roulette_depth=32)
"""A look at the picture: relative errors of 0.2 to 90 % on the pairs of `configs/tradeoff.yaml`, on the median 10 %."""
BALANCED = Preset(spp=128, max_depth=1024, roulette_depth=32)
"""The default: 0.1 to 30 %, on the median 3 %. Cutting paths earlier gains nothing (0.96 at 64 events), nor do other
numbers of samples (0.94 at 64, 1.05 at 256)."""
REFERENCE = Preset(spp=4096, max_depth=65536, roulette_depth=32)
"""For comparison with: no measurable bias from the bound on the path length."""

PRESETS: dict[str, Preset] = {"preview": PREVIEW, "balanced": BALANCED, "reference": REFERENCE}

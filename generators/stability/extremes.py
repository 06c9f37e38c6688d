"""The extremes that `fgf stability` tries: all of them, or for a quick look the outermost and some between."""

from __future__ import annotations

from dataclasses import dataclass, replace

from fgf_warp.scene import TRANSPORTS
from fgf_warp.theory.law import LINE_VARIANCES
from generators.stability.furnace import Experiment
from generators.stability.law import ExactGrid
from generators.stability.measurement import Axis, Value


def _decades(first: int, last: int, step: int = 1) -> tuple[float, ...]:
    return tuple(float(f"1e{exponent}") for exponent in range(first, last + 1, step))


HURSTS = (
    *(-1.0, -0.98, -0.979, -0.9, -0.75, -0.51, -0.5001, -0.5, -0.4999, -0.49, -0.25, -0.05, -0.01),
    *(0.0, 0.01, 0.3, 0.99, 1.0, 1.01, 1.6, 1.99, 2.0, 2.02, 2.6),
)
"""H, through every regime and up to every value where the variance is infinite, which are there too, to be refused."""
BS = (-0.958, -0.5, -0.02, -2e-4, 0.0, 2e-6, 2e-4, 0.02, 0.2, 0.5, 0.9, 0.98, 1.0)
"""b of these."""
DEPTHS = (1e-30, *_decades(-8, 8), 1e30)
"""u."""
ASYMMETRIES = (-0.9999, -0.99, -0.8, -1e-7, 0.0, 1e-7, 0.5, 0.8, 0.99, 0.9999)
ALBEDOS = (0.0, 0.1, 0.5, 0.9, 0.99, 0.999, 0.999999, 1.0)
OUTER_SCALES = (None, 0.01, 0.1, 1.0, 10.0, 1e3, 1e6)
KAPPAS = (0.0, 1e-8, 1e-2, 1.0, 1e2, 1e8)
BEST_SWEPT = tuple(transport for transport in TRANSPORTS if transport != "mixed")
"""The mixed transport takes a third of a second to find the rates of each pair of b and kappa."""


QUICK_EXPERIMENTS = ("absorption", "field", "albedo", "scale")


@dataclass(frozen=True)
class Extremes:
    """The grids of all parts.

    Args:
        bs: b of the law and its flights.
        kappas: of the law and its flights, > 0.
        depths: mean optical depths u of the law.
        exact: of the law with the exact variance of fractional Brownian motion.
        draws: flights of each law.
        asymmetries: g of the phase functions.
        hursts: H of the parameters.
        white_noise_scales: S_w.
        extinctions: sigma_m.
        outer_scales: L; None is not authored.
        scales: lengths of the scene, in which parameters are rescaled.
        experiments: renders.
    """

    bs: tuple[float, ...]
    kappas: tuple[float, ...]
    depths: tuple[float, ...]
    exact: ExactGrid
    draws: int
    asymmetries: tuple[float, ...]
    hursts: tuple[float, ...]
    white_noise_scales: tuple[float, ...]
    extinctions: tuple[float, ...]
    outer_scales: tuple[float | None, ...]
    scales: tuple[float, ...]
    experiments: tuple[Experiment, ...]


def _axes(**axes: tuple[Value, ...]) -> tuple[Axis, ...]:
    return tuple(Axis(name, values) for name, values in axes.items())


FULL = Extremes(
    bs=BS,
    kappas=_decades(-8, 8),
    depths=DEPTHS,
    exact=ExactGrid((0.01, 0.3, 0.5, 0.8, 0.99), (1e-6, 1e-2, 1.0, 1e2, 1e6), (1e-2, 1.0, 1e3, 1e6)),
    draws=512,
    asymmetries=ASYMMETRIES,
    hursts=HURSTS,
    white_noise_scales=(0.0, *_decades(-8, 8, 2)),
    extinctions=_decades(-6, 6, 2),
    outer_scales=OUTER_SCALES,
    scales=(1e-4, 1.0, 1e5),
    experiments=(
        Experiment(
            "absorption",
            "A sphere of radius 1 that does not scatter, seen through its centre: flights, law and geometry.",
            _axes(transport=TRANSPORTS, H=HURSTS, kappa=KAPPAS, sigma_m=_decades(-6, 6)),
            (("H", "kappa"), ("kappa", "sigma_m")),
            {"albedo": 0.0},
            {"kappa": 1.0, "sigma_m": 1.0},
            shows_law=True,
        ),
        Experiment(
            "exact variance",
            "The same with the exact variance of fractional Brownian motion.",
            _axes(
                transport=BEST_SWEPT,
                H=tuple(H for H in HURSTS if 0 < H < 1),
                kappa=KAPPAS,
                sigma_m=_decades(-6, 6, 2),
                L=(0.3, 10.0),
            ),
            (("H", "L"), ("kappa", "sigma_m")),
            {"albedo": 0.0, "line_variance": "exact"},
            {"kappa": 1.0, "sigma_m": 1.0, "L": 10.0},
            shows_law=True,
        ),
        Experiment(
            "field",
            "Every strength of the field and every mean extinction, in a sphere of radius 1.",
            _axes(
                transport=BEST_SWEPT,
                H=HURSTS,
                S_w=(0.0, *_decades(-8, 8, 2)),
                sigma_m=_decades(-6, 6, 2),
                g=(-0.9999, 0.0, 0.9999),
            ),
            (("H", "S_w"), ("H", "sigma_m")),
            {},
            {"S_w": 1.0, "sigma_m": 1.0, "g": 0.0},
        ),
        Experiment(
            "transport",
            "Every transport, at values of kappa that the field's parameters lead to.",
            _axes(transport=TRANSPORTS, H=HURSTS, kappa=(1e-8, 1e-2, 1.0, 1e2, 1e8), sigma_m=_decades(-6, 6, 4)),
            (("H", "kappa"),),
            {},
            {"sigma_m": 1e2},
        ),
        Experiment(
            "asymmetry",
            "Scattering that hardly turns the light, or throws it straight back, in pink noise of H = -0.25.",
            _axes(transport=TRANSPORTS, g=ASYMMETRIES, sigma_m=_decades(-6, 6, 2), kappa=(1e-2, 1.0, 1e2)),
            (("g", "sigma_m"),),
            {"H": -0.25},
            {"kappa": 1.0},
        ),
        Experiment(
            "outer scale",
            "The outer scale of fractional Brownian motion, with the asymptotic and the exact variance.",
            _axes(
                transport=BEST_SWEPT,
                line_variance=LINE_VARIANCES,
                H=tuple(H for H in HURSTS if H > 0),
                L=OUTER_SCALES,
                S_w=(1e-4, 1.0, 1e4),
            ),
            (("H", "L"),),
            {},
            {"S_w": 1.0},
        ),
        Experiment(
            "albedo",
            "Media that absorb, at kappa = 1.",
            _axes(transport=TRANSPORTS, H=HURSTS, albedo=ALBEDOS, sigma_m=(1e-2, 1.0, 1e2, 1e6)),
            (("H", "albedo"),),
            {"kappa": 1.0},
            {"sigma_m": 1e2},
        ),
        Experiment(
            "colour",
            "A medium whose extinction is 1, 0.3 and 0.03 of sigma_m in the three channels: the weights of its paths.",
            _axes(
                transport=BEST_SWEPT,
                H=HURSTS,
                S_w=(0.0, 1.0, 1e4),
                # Thick ones take minutes: no roulette ends a path.
                sigma_m=(1e-6, 1e-2, 1.0, 10.0),
                # Not 1: the weight of a path that is cut is not known.
                albedo=(0.0, 0.9),
            ),
            (("H", "S_w"), ("albedo", "sigma_m")),
            {"color": (1.0, 0.3, 0.03)},
            {"S_w": 1.0, "sigma_m": 1.0, "albedo": 0.9},
        ),
        Experiment(
            "roulette",
            "The same with Russian roulette from the first scattering event on.",
            _axes(transport=TRANSPORTS, H=HURSTS, albedo=(0.1, 0.5, 0.9, 0.99), sigma_m=(1.0, 1e2)),
            (("H", "albedo"),),
            {"kappa": 1.0},
            {"sigma_m": 1e2},
            has_roulette=True,
        ),
        Experiment(
            "scale",
            "Spheres of every size with the same extinction, sigma_m = 1, up to 100 000 mean free paths.",
            _axes(transport=TRANSPORTS, H=HURSTS, scale=_decades(-4, 5), g=(-0.9999, 0.0, 0.9999)),
            (("H", "scale"),),
            {"kappa": 1.0},
            {"g": 0.0},
        ),
        Experiment(
            "unit",
            "The same scene in other units of length, sigma_m, S_w and L rescaled with the sphere; albedo 0.9.",
            _axes(transport=BEST_SWEPT, H=HURSTS, scale=_decades(-4, 5)),
            (("H", "scale"),),
            {"albedo": 0.9, "S_w": 1.0, "sigma_m": 3.0, "L": 10.0},
            keeps_depth=True,
        ),
        Experiment(
            "connections",
            "The environment as two hemispheres that paths connect to: next-event estimation and its weights.",
            _axes(
                transport=TRANSPORTS,
                H=HURSTS,
                kappa=(1e-2, 1.0, 1e2),
                sigma_m=(1e-2, 1.0, 1e2),
                g=(-0.9, 0.0, 0.9999),
            ),
            (("H", "kappa"), ("g", "sigma_m")),
            {},
            {"H": -0.25, "kappa": 1.0, "sigma_m": 1.0, "g": 0.0},
            is_connected=True,
        ),
    ),
)


QUICK_HURSTS = (-0.98, -0.75, -0.5, -0.4999, -0.25, 0.0, 0.01, 1.6)


def _quick(experiment: Experiment) -> Experiment:
    """Of each axis of numbers the ends and one between; of H some of every regime and some refused; and one map."""

    def thinned(axis: Axis) -> Axis:
        if axis.name == "H":
            return Axis("H", tuple(value for value in axis.values if value in QUICK_HURSTS))
        if isinstance(axis.values[-1], str):
            return axis
        central = experiment.middle.get(axis.name, axis.values[len(axis.values) // 2])
        kept = (axis.values[0], central, axis.values[-1])
        return Axis(axis.name, tuple(value for value in axis.values if value in kept))

    return replace(experiment, axes=tuple(thinned(axis) for axis in experiment.axes), planes=experiment.planes[:1])


QUICK = Extremes(
    bs=(-0.958, -2e-4, 0.0, 2e-4, 0.5, 1.0),
    kappas=_decades(-8, 8, 4),
    depths=(1e-30, *_decades(-8, 8, 2), 1e30),
    exact=ExactGrid((0.01, 0.99), (1.0, 1e6), (1e6,)),
    draws=64,
    asymmetries=(-0.9999, 0.0, 0.9999),
    hursts=(*QUICK_HURSTS, 2.6),
    white_noise_scales=(0.0, 1.0, 1e8),
    extinctions=(1e-6, 1.0, 1e6),
    outer_scales=(None, 10.0, 1e6),
    scales=(1e-4, 1.0),
    experiments=tuple(_quick(experiment) for experiment in FULL.experiments if experiment.name in QUICK_EXPERIMENTS),
)

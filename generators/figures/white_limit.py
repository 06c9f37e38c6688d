"""Figure 4: towards white noise, where the renewal transport tends to the classical picture and the reciprocal jumps.

The medium of H = -0.49 has b = 0.02. For b -> 0 its transmittance tends to exp(-l u), l = l(kappa), which is that of
white noise, H = -1/2, with the same kappa. In the reciprocal transport a medium vertex keeps a memory of its place even
in the limit: Tmm tends to a share 1 - l of flights of no length and a share l of flights with the density
l exp(-l u). Where scattering is isotropic, a cluster of events at one place is one event of another albedo.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from matplotlib.axes import Axes
from scipy import stats

from fgf_warp.scene import Medium, Transport
from fgf_warp.theory.kernels import log1p_ratio, transmittance_ss
from generators.figures.agreement import BLOCK, LEVEL, Agreement, Estimate, compare, estimate_of, extrapolate
from generators.figures.chapter import Chapter, Exhibit, Shot
from generators.figures.sheet import picture_sheet
from generators.figures.studio import BALL_DIAMETER, describe_ball, describe_shots
from generators.plots import DIVERGING, image_bytes, new_figure, plot_style
from generators.report import Figure, Table, Verdict

KAPPA = 0.5
ALBEDO = 0.8
NEAR, FAR = -0.49, -0.48
"""b = 0.02 and twice that."""
HURSTS = (NEAR, FAR, -0.45, -0.4)
WHITE, SIGMA_M, PREDICTED = "white noise", "exponential of sigma_m", "predicted"
TRANSPORTS: tuple[Transport, ...] = ("renewal", "reciprocal")


@dataclass(frozen=True)
class Comparison:
    """A row of the table.

    Args:
        found: what is compared.
        expected: with what.
        agreement: the outcome.
        expected_to_hold: what the theory says; None where finite b may show.
    """

    found: str
    expected: str
    agreement: Agreement
    expected_to_hold: bool | None

    @property
    def surprising(self) -> bool:
        """Whether the outcome is not what the theory says."""
        return self.expected_to_hold is not None and self.agreement.holds != self.expected_to_hold


def equivalent_medium(medium: Medium) -> Medium:
    """The classical medium that isotropic reciprocal transport tends to for b -> 0+.

    Rate l and albedo a l / (1 - a (1-l)): from a vertex that the path has reached, a share a scatters; of that 1 - l
    meets the next vertex in the same place, and l leaves it.
    """
    rate = float(log1p_ratio(medium.line_law.kappa))
    red, green, blue = (a * rate / (1 - a * (1 - rate)) for a in medium.albedo)
    return replace(
        medium,
        hurst=-0.5,
        kappa=0.0,
        transport=None,
        mean_extinction=medium.mean_extinction * rate,
        albedo=(red, green, blue),
    )


def media(cloud: Medium) -> list[Medium]:
    """The three exponentials, then each H in each transport."""
    ball = replace(cloud, asymmetry=0.0, albedo=(ALBEDO,) * 3, hurst=-0.5, kappa=KAPPA)
    correlated = [replace(ball, hurst=hurst, transport=transport) for transport in TRANSPORTS for hurst in HURSTS]
    return [ball, replace(ball, kappa=0.0), equivalent_medium(ball), *correlated]


def draw(shots: Sequence[Shot]) -> Chapter:
    """Pictures, differences with their z, the way to the limit, and the table."""
    estimates = estimates_by_name(shots)
    comparisons = compare_all(estimates)
    white, _, predicted = (shot.medium for shot in shots[:3])
    rate = predicted.mean_extinction / white.mean_extinction
    gap = _largest_gap(white)
    how = f"kappa = {KAPPA:g}; {describe_ball(white)}; g = 0. {describe_shots(shots)}"
    return Chapter(
        paragraphs=(
            "The supplement shows that H = -0.49 gives the picture of the classical exponential. Which exponential, "
            "and in which transport, decides whether that is so.",
            "At H = -1/2 the transmittance is exponential at the rate l(kappa) sigma_m, l = ln(1 + kappa)/kappa = "
            f"{rate:.4f}, not at the rate sigma_m, to which it tends for S_w -> 0 only. H = -0.49 has b = 0.02, and "
            f"its transmittance differs from that limit by at most {gap:.1e} at any depth of the ball. So it is "
            "compared with white noise of the same kappa.",
            "In the renewal transport, where a flight forgets the ones before it, the law is all there is, and the "
            "pictures should agree. In the reciprocal transport a flight from a medium vertex knows that it starts in "
            "matter: as b -> 0+ a share 1 - l of these flights has no length, events cluster, and more light is "
            "absorbed than at H = -1/2 exactly. For isotropic scattering the limit is a classical medium of rate "
            f"l sigma_m = {predicted.mean_extinction:.4f} and albedo a l / (1 - a (1 - l)) = {predicted.albedo[0]:.4f},"
            " which predicts the difference. Whether the pictures bear this out, the table and the verdict say.",
        ),
        figures={
            "limit-pictures": Figure(
                "Four renders",
                f"The right two should be a little darker, and alike. {how}",
                picture_sheet(
                    [
                        [
                            shots[0].result.radiance,
                            *(_shot(shots, t).result.radiance for t in TRANSPORTS),
                            shots[2].result.radiance,
                        ]
                    ],
                    columns=["H = -0.5", f"H = {NEAR:g}", f"H = {NEAR:g}", "predicted"],
                    rows=[""],
                    notes=[["white noise", *TRANSPORTS, "for reciprocal"]],
                ),
                "png",
            ),
            "limit-differences": Figure(
                "Differences and their z",
                "Above: differences of the green channel over the mean of the picture of white noise. Middle: the "
                f"same in blocks of {BLOCK} x {BLOCK} pixels, over its standard error. Below: how these z are "
                "distributed, against the standard normal, which they follow where the pictures agree. First column: "
                "renewal less white noise. Second and third: reciprocal less white noise, measured and predicted. "
                f"Fourth: measured less predicted. {how}",
                _plot_differences(estimates),
                "png",
            ),
            "limit-approach": Figure(
                "On the way to white noise",
                "Mean difference from the picture of white noise, against b = 1 + 2H, with standard errors. At b = 0 "
                "stands what the theory says of the limit: nothing for renewal, and for reciprocal the "
                f"difference of the predicted medium. {how}",
                _plot_approach(estimates),
                "svg",
            ),
        },
        tables=(_table(comparisons),),
        verdict=_judge(comparisons, estimates),
    )


def compare_all(estimates: dict[str, Estimate]) -> list[Comparison]:
    """The comparisons of the table.

    Args:
        estimates: by name, as `WHITE`, `PREDICTED`, and `labelled` for the others.

    Returns:
        In the order of the table, each with what the theory expects of it.
    """
    white, predicted = estimates[WHITE], estimates[PREDICTED]
    found = {
        transport: (estimates[labelled(transport, NEAR)], estimates[labelled(transport, FAR)])
        for transport in TRANSPORTS
    }
    limit = {transport: extrapolate(*pair) for transport, pair in found.items()}
    rows = (
        (labelled("renewal", NEAR), found["renewal"][0], WHITE, white, None),
        ("renewal, b -> 0", limit["renewal"], WHITE, white, True),
        (labelled("renewal", NEAR), found["renewal"][0], SIGMA_M, estimates[SIGMA_M], False),
        (labelled("reciprocal", NEAR), found["reciprocal"][0], WHITE, white, False),
        (PREDICTED, predicted, WHITE, white, False),
        (labelled("reciprocal", NEAR), found["reciprocal"][0], PREDICTED, predicted, None),
        ("reciprocal, b -> 0", limit["reciprocal"], PREDICTED, predicted, True),
    )
    return [Comparison(name, other, compare(a, b), holds) for name, a, other, b, holds in rows]


def labelled(transport: Transport, hurst: float) -> str:
    """Name of an estimate."""
    return f"{transport}, H = {hurst:g}"


def estimates_by_name(shots: Sequence[Shot]) -> dict[str, Estimate]:
    """The pictures of `media` as estimates, by the names that `compare_all` knows them by."""
    names = [WHITE, SIGMA_M, PREDICTED, *(labelled(t, hurst) for t in TRANSPORTS for hurst in HURSTS)]
    return {name: estimate_of(shot.result) for name, shot in zip(names, shots, strict=True)}


def _shot(shots: Sequence[Shot], transport: Transport) -> Shot:
    return next(s for s in shots if s.medium.transport == transport and s.medium.hurst == NEAR)


def _largest_gap(white: Medium) -> float:
    """Largest difference of the transmittances of H = -0.49 and of white noise over the depths of the ball."""
    u = np.linspace(1e-6, BALL_DIAMETER * white.mean_extinction, 4000)
    return float(np.abs(transmittance_ss(1 + 2 * NEAR, KAPPA, u) - transmittance_ss(0.0, KAPPA, u)).max())


def _judge(comparisons: Sequence[Comparison], estimates: dict[str, Estimate]) -> Verdict:
    near = comparisons[0].agreement
    outcome = (
        "they agree within noise"
        if near.holds
        else f"they differ, by {near.mean:+.2%} ± {near.mean_error:.2%} of the mean"
    )
    white = estimates[WHITE]
    measured = compare(estimates[labelled("reciprocal", NEAR)], white)
    predicted = compare(estimates[PREDICTED], white)
    surprises = [f"{row.found} against {row.expected}" for row in comparisons if row.surprising]
    theory = f"Not as the theory says: {'; '.join(surprises)}." if surprises else "The limits are as the theory says."
    return Verdict(
        not surprises,
        f"Renewal transport at H = {NEAR:g} against white noise: {outcome}. Reciprocal transport: a difference of "
        f"{measured.mean:+.2%} ± {measured.mean_error:.2%} is measured, and {predicted.mean:+.2%} ± "
        f"{predicted.mean_error:.2%} predicted. {theory}",
    )


def _table(comparisons: Sequence[Comparison]) -> Table:
    return Table(
        title="Agreement in numbers",
        caption="Difference of the means, relative, with its standard error; the smallest difference that the test "
        "would see; root mean square of the blocks' z, which is 1 for equal pictures; probability of such a sum of "
        f"their squares by chance. Two pictures agree where both tests have p >= {LEVEL:g}. For b -> 0 the pictures "
        f"of H = {NEAR:g} and H = {FAR:g} are extrapolated. The last column is what the theory says; at b = 0.02 "
        "enough samples see the distance from the limit. Rows that are not as it says are marked.",
        columns=("picture", "against", "difference", "visible", "rms z", "blocks", "chi-square p", "found", "theory"),
        rows=tuple(_row(comparison) for comparison in comparisons),
        failed=frozenset(i for i, comparison in enumerate(comparisons) if comparison.surprising),
    )


def _row(comparison: Comparison) -> tuple[str, ...]:
    found = comparison.agreement
    theory = {True: "agree", False: "differ", None: "nearly agree"}[comparison.expected_to_hold]
    return (
        comparison.found,
        comparison.expected,
        f"{found.mean:+.3%} ± {found.mean_error:.3%}",
        f"{found.visible_mean:.2%}",
        f"{found.rms_z:.3f}",
        f"{found.noisy_z.size}",
        _probability(found.chi_square_p),
        "agree" if found.holds else "differ",
        theory,
    )


def _probability(p: float) -> str:
    return f"{p:.2g}" if p >= 1e-9 else "below 1e-9"


def _plot_differences(estimates: dict[str, Estimate]) -> bytes:
    white, predicted = estimates[WHITE], estimates[PREDICTED]
    renewal, reciprocal = (estimates[labelled(transport, NEAR)] for transport in TRANSPORTS)
    columns = {
        f"renewal, H = {NEAR:g}\nless white noise": (renewal, white),
        f"reciprocal, H = {NEAR:g}\nless white noise": (reciprocal, white),
        "predicted\nless white noise": (predicted, white),
        f"reciprocal, H = {NEAR:g}\nless predicted": (reciprocal, predicted),
    }
    scale = white.mean.mean()
    limit = 2 * float(np.abs((predicted - white).blocks().mean).max() / scale)
    with plot_style():
        figure = new_figure(11, 8.2)
        axes = figure.subplots(3, len(columns), height_ratios=(1, 1, 0.8))
        for (top, middle, bottom), (title, (found, expected)) in zip(axes.T, columns.items(), strict=True):
            change = top.imshow((found - expected).mean / scale, cmap=DIVERGING, vmin=-limit, vmax=limit)
            agreement = compare(found, expected)
            blocks = middle.imshow(agreement.z, cmap=DIVERGING, vmin=-6, vmax=6)
            top.set_title(title)
            top.axis("off")
            middle.axis("off")
            _plot_histogram(bottom, agreement)
        figure.colorbar(change, ax=axes[0], shrink=0.85, label="difference / mean")
        figure.colorbar(blocks, ax=axes[1], shrink=0.85, label="z of blocks")
        return image_bytes(figure, "png")


def _plot_histogram(axis: Axes, agreement: Agreement) -> None:
    edges, z = np.linspace(-8, 8, 33), np.linspace(-8, 8, 321)
    axis.hist(np.clip(agreement.noisy_z, -8, 8), list(edges), density=True, color="#9db4d3")
    axis.plot(z, stats.norm.pdf(z), color="black", linewidth=1)
    axis.set(xlim=(-8, 8), ylim=(0, 0.6), xlabel="z")
    axis.set_title(f"rms {agreement.rms_z:.2f}, p {_probability(agreement.chi_square_p)}")


def _plot_approach(estimates: dict[str, Estimate]) -> bytes:
    white = estimates[WHITE]
    limits = {"renewal": None, "reciprocal": compare(estimates[PREDICTED], white)}
    with plot_style():
        figure = new_figure(7, 4)
        axis = figure.subplots()
        for transport, color in zip(TRANSPORTS, ("#1f5fae", "#b3401e"), strict=True):
            changes = [compare(estimates[labelled(transport, hurst)], white) for hurst in HURSTS]
            b, percent = [1 + 2 * hurst for hurst in HURSTS], [100 * change.mean for change in changes]
            errors = [100 * change.mean_error for change in changes]
            axis.errorbar(b, percent, errors, fmt="o-", color=color, linewidth=1, capsize=3, label=transport)
            limit = limits[transport]
            height, error = (0.0, 0.0) if limit is None else (100 * limit.mean, 100 * limit.mean_error)
            axis.errorbar(
                [0],
                [height],
                [error],
                fmt="D",
                color=color,
                capsize=3,
                markerfacecolor="white",
                label=f"{transport}, limit b -> 0+",
                clip_on=False,
            )
        axis.axhline(0, color="black", linewidth=0.8)
        axis.margins(y=0.1)
        axis.set(xlabel="b = 1 + 2H", ylabel="mean difference from white noise [%]", xlim=(0, None))
        axis.legend()
        return image_bytes(figure)


EXHIBIT = Exhibit("white-limit", "Figure 4: H = -0.49 against the classical exponential", media, draw)

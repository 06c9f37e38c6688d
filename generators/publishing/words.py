"""How the facts of a plan are put into words."""

from __future__ import annotations

from generators.dataset.plan_table import PlanMeta, is_open

DOI = "10.1145/3306346.3323031"
CITATION = (
    "Jie Guo, Yanjun Chen, Bingyang Hu, Ling-Qi Yan, Yanwen Guo and Yuntao Liu: Fractional Gaussian Fields for "
    "Modeling and Rendering of Spatially-Correlated Media. ACM Transactions on Graphics 38(4), 2019."
)


def describe(meta: PlanMeta) -> str:
    """What the dataset is, in a sentence or two, of which the author's come first."""
    axes = [axis.name for axis in meta.axes]
    listed = f"{', '.join(axes[:-1])} and {axes[-1]}" if len(axes) > 1 else "".join(axes)
    swept = f" that differ in {listed}" if axes else ""
    made = f"Path-traced images of {meta.scene}{swept}, rendered with FGF-Warp."
    return f"{meta.description} {made}".strip()


def describe_quality(meta: PlanMeta) -> str:
    """What bounds each sample's render: ``64 spp``, or ``relative error 2 % (p95), at most 4096 spp``."""
    over = f" ({meta.quality['error_over']})" if "error_over" in meta.quality else ""
    bounds = {
        "target_error": lambda value: f"relative error {100 * value:g} %{over}",
        "time": lambda value: f"{value:g} s",
        "spp": lambda value: f"{'at most ' if is_open(meta.quality) else ''}{value:g} spp",
    }
    said = [words(meta.quality[name]) for name, words in bounds.items() if name in meta.quality]
    return ", ".join([*said, *(["settings chosen for each sample"] if "chosen_from" in meta.quality else [])])

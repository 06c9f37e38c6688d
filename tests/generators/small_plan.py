"""A plan in code, of a sphere of medium, for tests of running it."""

import hashlib
from collections.abc import Hashable, Mapping
from dataclasses import dataclass, replace

import pyarrow as pa

from fgf_warp.scene import Medium, Scene
from fgf_warp.settings import Aov, RenderSettings
from generators.dataset import layout
from generators.dataset.plan_table import AxisMeta, PlanMeta, write_plan
from tests.scenes import furnace


@dataclass(frozen=True, eq=False)
class SmallSample:
    index: int
    split: str
    parameters: Mapping[str, float]
    seed: int
    medium: Medium

    @property
    def name(self) -> str:
        return layout.sample_name(self.index)


@dataclass(frozen=True, eq=False)
class SmallPlan:
    meta: PlanMeta
    samples: tuple[SmallSample, ...]
    settings: RenderSettings
    scene: Scene

    def group_key(self, sample: SmallSample) -> Hashable:
        return sample.medium.line_law.kind

    def scene_of(self, sample: SmallSample) -> Scene:
        return self.scene

    def media_of(self, sample: SmallSample) -> tuple[Medium, ...]:
        return (sample.medium,)

    def to_bytes(self) -> bytes:
        rows = [
            {"index": s.index, "split": s.split, "seed": s.seed, **s.parameters, "L": None, "sigma_m": 2.5}
            for s in self.samples
        ]
        table = pa.table({name: pa.array([row[name] for row in rows]) for name in rows[0]})
        return write_plan(self.meta, table)


def small_plan(
    hurst=(-0.5, -0.25), asymmetry=(-0.5, 0.0, 0.5), *, quality=None, size=16, spp=4, seed=7, memory=4.0
) -> SmallPlan:
    """Samples of a furnace, every third one for validation."""
    scene = furnace(white_noise_scale=1.0, albedo=(0.9, 0.8, 0.7), fills_view=False)
    cells = [(h, g) for h in hurst for g in asymmetry]
    samples = tuple(
        SmallSample(
            index,
            layout.SPLITS[index % 3 == 2],
            {"H": h, "g": g},
            1000 * seed + index,
            replace(scene.media[0], hurst=h, asymmetry=g),
        )
        for index, (h, g) in enumerate(cells)
    )
    settings = RenderSettings(width=size, height=size, spp=spp, aovs=frozenset({Aov.VARIANCE}), memory=memory)
    meta = PlanMeta(
        name="small",
        digest=hashlib.sha256(repr((cells, quality, size, spp, seed)).encode()).hexdigest(),
        version="0.1.0",
        seed=seed,
        scene="",
        medium="/medium",
        axes=(AxisMeta("H", "H", tuple(hurst)), AxisMeta("g", "g", tuple(asymmetry))),
        width=size,
        height=size,
        aovs=("variance",),
        quality={"spp": spp} if quality is None else quality,
    )
    return SmallPlan(meta, samples, settings, scene)

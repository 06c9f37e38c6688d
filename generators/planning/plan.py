"""The plan of a dataset: its samples, what they share, and the scenes that they are renders of."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import pyarrow as pa

from fgf_warp import __version__
from fgf_warp.errors import ConfigError, FgfError, SceneError
from fgf_warp.scene import Medium, Scene
from fgf_warp.settings import RenderSettings
from generators.dataset.layout import sample_name
from generators.dataset.plan_table import INDEX, SEED, SPLIT, AxisMeta, PlanMeta, write_plan
from generators.planning.config import SweepConfig
from generators.planning.digest import content_hash
from generators.planning.document import LoadedConfig
from generators.planning.resolve import Axis, Sweep, resolve, touches_medium
from generators.planning.sampling import (
    Parameters,
    assign_splits,
    described,
    position_count,
    sample_parameters,
    sample_seed,
)
from generators.planning.scenes import Key, Recipe, SceneReader, stage_name
from generators.planning.targets import MEDIUM_FIELDS
from generators.stage import BaseScene
from generators.tradeoff.front import read_front

Progress = Callable[[int, int], None]
PHASE_PARAMETERS = ("back_asymmetry", "back_weight", "draine_alpha")
WARNINGS_SHOWN = 5


@dataclass(frozen=True, eq=False)
class Sample:
    """One image of a dataset.

    Args:
        index: position in the dataset, from 0.
        split: that it belongs to.
        parameters: values of the axes, by column, in their order.
        seed: of the render, in [0, 2^63).
        medium: the swept one with its parameters; None where the scene has none.
        scene: hash of its scene, up to the swept medium.
    """

    index: int
    split: str
    parameters: Mapping[str, float | str]
    seed: int
    medium: Medium | None
    scene: str

    @property
    def name(self) -> str:
        """Of its folder."""
        return sample_name(self.index)


@dataclass(frozen=True, eq=False)
class Plan:
    """All that is to be rendered; small when it is sent to another process, which reads the scenes anew.

    Args:
        meta: what the samples share, as readers of the dataset meet it.
        samples: by index; a part of a plan has fewer.
        settings: what the samples share, but for the seed.
        scenes: reads the samples' scenes.
        warnings: what a user should know of scenes and media.
        left_out: positions that constraints left out.
    """

    meta: PlanMeta
    samples: tuple[Sample, ...]
    settings: RenderSettings
    scenes: SceneReader
    warnings: tuple[str, ...] = ()
    left_out: int = 0

    def group_key(self, sample: Sample) -> Hashable:
        """Equal of samples that share one scene up to the swept medium."""
        return self.scenes.recipe.key(sample.parameters)

    def scene_of(self, sample: Sample) -> Scene:
        """The scene of the sample's group; the last few that were asked for are kept.

        Raises:
            FgfError: where the stage is no longer there, accepted or what it was when the plan was made.
        """
        base, found = self.scenes.read(self.scenes.recipe.key(sample.parameters))
        if found != sample.scene:
            raise SceneError(f"{base.scene.source}: has changed since the plan was made")
        return base.scene

    def media_of(self, sample: Sample) -> tuple[Medium, ...]:
        """The scene's media with the sample's in its place."""
        scene = self.scene_of(sample)
        if sample.medium is None:
            return scene.media
        return tuple(sample.medium if medium.name == sample.medium.name else medium for medium in scene.media)

    def of_dataset(self, location: str) -> Plan:
        """The same of the stages that a dataset holds, wherever those are that the plan was made of."""
        return replace(self, scenes=SceneReader(replace(self.scenes.recipe, dataset=location)))

    def to_bytes(self) -> bytes:
        """The content of ``plan.parquet``."""
        return write_plan(self.meta, plan_table(self))


def build_plan(loaded: LoadedConfig, device: str = "cpu", progress: Progress | None = None) -> Plan:
    """Lists the samples and checks every one.

    Args:
        loaded: the dataset's config.
        device: to render on. CPU and CUDA round differently, so a dataset is made on one kind.
        progress: called with the number of scenes read, and of all.

    Raises:
        ConfigError: for axes that contradict each other or the stage, or a sample out of the law's domain, by index
            and values.
        SceneError: for a stage that is not accepted, or has no such medium, or no single one.
    """
    config = loaded.config
    sweep = resolve(loaded)
    parameters = sample_parameters(loaded, sweep)
    try:
        splits = assign_splits(config.splits, config.seed, parameters)
    except ConfigError as error:
        raise loaded.error(("splits",), str(error)) from error
    scenes = SceneReader(_recipe(loaded, sweep))
    survey = _survey(loaded, sweep, scenes, parameters, progress or (lambda done, total: None))
    samples = tuple(
        Sample(index, split, values, sample_seed(config.seed, index), medium, scene)
        for index, (split, values, medium, scene) in enumerate(
            zip(splits, parameters, survey.media, survey.scenes, strict=True)
        )
    )
    settings = config.render_settings(*survey.size, device)
    meta = _meta(loaded, sweep, survey, settings, scenes.recipe)
    count = position_count(sweep, config.draws)
    warnings = [*survey.warnings]
    if config.design == "sobol" and count & (count - 1):
        warnings.append(f"{count} samples of a Sobol sequence: it is even over powers of 2 alone")
    return Plan(
        meta=replace(meta, digest=_digest(config, meta, settings, survey, samples)),
        samples=samples,
        settings=settings,
        scenes=scenes,
        warnings=tuple(warnings),
        left_out=count - len(samples),
    )


def plan_table(plan: Plan) -> pa.Table:
    """The frozen plan: one row per sample.

    Short names and units as in the configs; one flat column per number, since those load everywhere. ``S_w`` is null
    where kappa was authored in its place, ``L`` where there is none. ``sigma_m``, ``kappa`` and ``b`` are those in
    force: a grey extinction color is a factor of ``sigma_m``; of a chromatic medium, whose channels differ in them,
    they are the ones before the color. What an axis sets has the axis' value.
    """
    columns: dict[str, tuple[pa.DataType, list[Any]]] = {
        INDEX: (pa.int64(), [sample.index for sample in plan.samples]),
        SPLIT: (pa.string(), [sample.split for sample in plan.samples]),
        SEED: (pa.int64(), [sample.seed for sample in plan.samples]),
    }
    for axis in plan.meta.axes:
        kind = pa.string() if axis.category else pa.float64()
        columns[axis.name] = (kind, [sample.parameters[axis.name] for sample in plan.samples])
    rows = [{} if sample.medium is None else _labels(sample.medium) for sample in plan.samples]
    first = next(filter(None, rows), {})
    for name in (name for name in first if name not in columns):
        columns[name] = (pa.string() if isinstance(first[name], str) else pa.float64(), [row.get(name) for row in rows])
    return pa.table({name: pa.array(values, kind) for name, (kind, values) in columns.items()})


def _labels(medium: Medium) -> dict[str, float | str | None]:
    law = medium.line_law
    return {
        "H": medium.hurst,
        "g": medium.asymmetry,
        "S_w": medium.white_noise_scale if medium.kappa is None else None,
        "sigma_m": law.mean_extinction,
        "albedo_r": medium.albedo[0],
        "albedo_g": medium.albedo[1],
        "albedo_b": medium.albedo[2],
        "L": medium.outer_scale,
        "regime": law.regime,
        "b": law.b,
        "kappa": law.kappa,
        "transport": medium.resolved_transport,
        "line_variance": medium.line_variance,
        "phase_function": medium.phase_function,
        **{name: getattr(medium, name) for name in PHASE_PARAMETERS},
    }


@dataclass(frozen=True, eq=False)
class _Survey:
    """What reading every scene of a plan came to.

    Args:
        size: of the images [pixel].
        media: the swept medium of every sample.
        scenes: hash of the scene of every sample.
        warnings: of scenes and media.
    """

    size: tuple[int, int]
    media: tuple[Medium | None, ...]
    scenes: tuple[str, ...]
    warnings: tuple[str, ...]


def _recipe(loaded: LoadedConfig, sweep: Sweep) -> Recipe:
    config = loaded.config
    names = [config.scene] if config.scene else []
    for axis in sweep.axes:
        if axis.target.kind == "scene":
            names.extend(str(value) for value in axis.config.grid_values())
    stages: dict[str, str] = {}
    for name in names:
        called = stage_name(name)
        if called in stages:
            raise loaded.error(("axes",), f"two stages are called {called}; accepted: files of different names")
        stages[called] = str(loaded.file(name).absolute())  # A worker may start in another folder.
    return Recipe(
        stages=stages,
        targets={axis.name: axis.target for axis in sweep.axes if axis.target.kind != "medium"},
        camera=config.camera,
        orbit=config.orbit,
        frame=config.frame,
        width=config.image.width,
        height=config.image.height,
    )


def _survey(
    loaded: LoadedConfig, sweep: Sweep, scenes: SceneReader, parameters: list[Parameters], progress: Progress
) -> _Survey:
    """Reads the scene of each group once, and makes the media of its samples."""
    groups: dict[Key, list[int]] = {}
    for index, values in enumerate(parameters):
        groups.setdefault(scenes.recipe.key(values), []).append(index)
    media: list[Medium | None] = [None] * len(parameters)
    sizes: dict[tuple[int, int], int] = {}
    hashes = [""] * len(parameters)
    of_scenes, of_media = dict[str, None](), dict[str, int]()
    for read, (key, indices) in enumerate(groups.items(), start=1):
        base, found = _read(loaded, sweep, scenes, key, indices[0], parameters)
        sizes.setdefault((base.width, base.height), indices[0])
        progress(read, len(groups))
        of_scenes |= dict.fromkeys(base.warnings)
        place = _medium_index(loaded, sweep, base.scene)
        for index in indices:
            hashes[index] = found
            if place is None:
                continue
            media[index] = medium = _medium(loaded, sweep, base.scene, place, index, parameters[index])
            for warning in base.scene.medium_warnings(place, medium):
                of_media.setdefault(warning, index)
    if len(sizes) > 1:
        found = " and ".join(f"{width} x {height} (sample {index})" for (width, height), index in sizes.items())
        raise ConfigError(f"{loaded.path}: images of {found}; accepted: one size, as by image.width and image.height")
    idle = _idle(scenes, list(groups))
    scenes.close()
    told = [f"sample {index}: {warning}" for warning, index in of_media.items()]
    return _Survey(next(iter(sizes)), tuple(media), tuple(hashes), (*of_scenes, *idle, *_few(told)))


def _read(
    loaded: LoadedConfig, sweep: Sweep, scenes: SceneReader, key: Key, index: int, parameters: list[Parameters]
) -> tuple[BaseScene, str]:
    try:
        return scenes.read(key)
    except FgfError as error:
        from usd_scenes.reader import EditError  # noqa: PLC0415

        if not key:
            raise
        found = ConfigError(f"sample {index}: with {described(parameters[index])}: {error}")
        if isinstance(error, EditError):
            for axis in sweep.axes:
                if axis.target.prim and f"{axis.target}: " in str(error):
                    raise loaded.error(("axes", axis.key), str(found)) from error
        raise found from error


def _medium_index(loaded: LoadedConfig, sweep: Sweep, scene: Scene) -> int | None:
    """Of the swept medium; None where there is none, and none is needed."""
    config = loaded.config
    if scene.media or config.medium:
        return scene.medium_index(config.medium)
    if touches_medium(sweep.axes):
        raise loaded.error(("axes",), f"{scene.source} has no medium to sweep")
    if config.targets.transmittance or config.targets.mean_free_path:
        raise loaded.error(("targets",), f"{scene.source} has no medium")
    return None


def _medium(loaded: LoadedConfig, sweep: Sweep, scene: Scene, place: int, index: int, parameters: Parameters) -> Medium:
    """The swept medium with a sample's parameters."""
    base = scene.media[place]
    if base.kappa is not None and any(axis.target.name == "S_w" for axis in sweep.axes):
        raise ConfigError(
            f"axes.S_w: {base.name} authors kappa = {base.kappa:g}, which takes the place of S_w; "
            "accepted: an axis kappa, or a stage without it"
        )
    config = loaded.config
    asked = {"transport": config.transport, "line_variance": config.line_variance}
    changes: dict[str, Any] = {name: value for name, value in asked.items() if value is not None}
    albedo: list[Any] = [*base.albedo]
    for axis in sweep.axes:
        name = axis.target.name
        if axis.target.kind != "medium":
            continue
        value = parameters[axis.name]
        if MEDIUM_FIELDS[name] != "albedo":
            changes[MEDIUM_FIELDS[name]] = value
            continue
        for channel, letter in enumerate("rgb"):
            if name in ("albedo", f"albedo_{letter}"):
                albedo[channel] = value
        changes["albedo"] = tuple(albedo)
    try:
        medium = replace(base, **changes)
        _check_lengths(config, medium)
        if medium.line_variance == "exact":
            # Refused where the medium is too large for its law.
            scene.with_medium(place, medium)
    except SceneError as error:
        raise ConfigError(f"sample {index}: {error}") from error
    return medium


def _check_lengths(config: SweepConfig, medium: Medium) -> None:
    """Refuses a transmittance curve that goes on where the law ends."""
    if config.targets.transmittance:
        longest, reach = max(config.targets.transmittance.grid_values()), medium.line_law.longest_segment()
        if longest > reach:  # type: ignore[operator]
            raise SceneError(f"targets.transmittance: t = {longest:g}; accepted: at most {reach:g}, where the law ends")


def _idle(scenes: SceneReader, keys: Sequence[Key]) -> list[str]:
    """Warnings of axes that leave the first scene as it is, as a light that is off would."""
    found = []
    for place, (name, target) in enumerate(scenes.recipe.targets.items()):
        others = [key[place] for key in keys if key[place] != keys[0][place]]
        if others and target.kind in ("attribute", "variants"):
            changed = (*keys[0][:place], others[0], *keys[0][place + 1 :])
            try:
                has_changed = scenes.read(changed)[1] != scenes.read(keys[0])[1]
            except FgfError:
                continue  # No such sample is planned.
            if not has_changed:
                values = f"{described({name: keys[0][place]})} and {described({name: others[0]})}"
                found.append(f"axis {name}: with {values} the scene is the same")
    return found


def _few(warnings: list[str]) -> list[str]:
    """No more of them than one reads."""
    if len(warnings) <= WARNINGS_SHOWN:
        return warnings
    return [*warnings[:WARNINGS_SHOWN], f"and {len(warnings) - WARNINGS_SHOWN} more such warnings"]


def _meta(loaded: LoadedConfig, sweep: Sweep, survey: _Survey, settings: RenderSettings, recipe: Recipe) -> PlanMeta:
    """All but the digest."""
    config = loaded.config
    names = {medium.name: None for medium in survey.media if medium is not None}
    targets: dict[str, Any] = {}
    if config.targets.transmittance:
        targets["transmittance"] = {"t": list(config.targets.transmittance.grid_values())}
    if config.targets.mean_free_path:
        targets["mean_free_path"] = True
    return PlanMeta(
        name=config.name,
        digest="",
        version=__version__,
        seed=config.seed,
        scene=", ".join(recipe.stages),
        stages=tuple(recipe.stages),
        medium=", ".join(names),
        axes=tuple(_axis_meta(axis) for axis in sweep.axes),
        width=settings.width,
        height=settings.height,
        aovs=tuple(sorted(settings.aovs)),
        png=config.png,
        exposure=config.exposure,
        quality=config.bounds | ({"chosen_from": content_hash(asdict(read_front()))} if config.wish else {}),
        targets=targets,
        device="cuda" if settings.device.startswith("cuda") else settings.device,
        description=config.description,
        license=config.license,
    )


def _axis_meta(axis: Axis) -> AxisMeta:
    return AxisMeta(axis.name, str(axis.target), axis.values, axis.target.has_names, axis.target.unit)


def _digest(
    config: SweepConfig, meta: PlanMeta, settings: RenderSettings, survey: _Survey, samples: Iterable[Sample]
) -> str:
    """SHA-256 of a canonical form of all that the samples' files depend on.

    Scenes count by their content, wherever their layers lie; what only describes the dataset does not count.
    """
    rest = {name: value for name, value in asdict(meta).items() if name not in ("description", "license")}
    kept = asdict(settings)
    for execution in ("threads", "memory", "seed", "device"):
        del kept[execution]
    return content_hash(
        {
            "meta": rest,
            "settings": {**kept, "aovs": sorted(settings.aovs)},
            "medium": [config.transport, config.line_variance],
            "samples": [[sample.split, *sample.parameters.values(), sample.seed, sample.scene] for sample in samples],
        }
    )

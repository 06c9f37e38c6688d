"""Reads the lights of a stage again where nothing else of it was edited: datasets are of one scene in any light."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from pxr import Tf, Usd

from fgf_warp.errors import FgfError
from fgf_warp.scene import Light, Scene
from usd_scenes.reader.context import StageContext
from usd_scenes.reader.edits import Edits
from usd_scenes.reader.lights import read_light
from usd_scenes.reader.policy import Policy

ON_LIGHTS_ALONE = ("inputs:", "xformOp:")
"""What names of attributes begin with whose numbers are read where a light is, and nowhere else."""


@dataclass(frozen=True, eq=False)
class KeptScene:
    """The scene of an edited stage, while it is open.

    Args:
        scene: that it came to.
        edits: of the stage.
        context: that it was read in.
        notes: what there was to tell of its lights.
    """

    scene: Scene
    edits: Edits
    context: StageContext
    notes: tuple[tuple[str, str], ...]

    @classmethod
    def of(cls, scene: Scene, edits: Edits, context: StageContext) -> KeptScene | None:
        """What was read of a stage that has these edits now; None where none of them is of a light alone."""
        if not any(_is_of_light(target, scene, context.stage) for target in edits):
            return None
        found = _read_lights(scene.lights, context)
        return None if found is None else cls(scene, dict(edits), context, found[1])

    def with_lights(self, edits: Edits) -> Scene | None:
        """What would be read of the stage with other edits, which it has now.

        None where that would differ in more than the lights' numbers: other edits have changed, something else depends
        on these lights, or there is something else to tell or to refuse.
        """
        if edits.keys() != self.edits.keys():
            return None
        changed = (target for target, value in edits.items() if value != self.edits[target])
        if not all(_is_of_light(target, self.scene, self.context.stage) for target in changed) or self._is_shared:
            return None
        found = _read_lights(self.scene.lights, self.context)
        if found is None or found[1] != self.notes:
            return None
        return replace(self.scene, lights=found[0])

    @cached_property
    def _is_shared(self) -> bool:
        """True where another prim may take what was edited: it is connected to it, or a copy of the edited prim."""
        stage = self.context.stage
        edited = stage.GetSessionLayer()
        lights = {light.name for light in self.scene.lights}
        sources = stage.GetPseudoRoot().FindAllAttributeConnectionPaths()
        return any(str(source.GetPrimPath()) in lights for source in sources) or any(
            spec.layer == edited and spec.path != prim.GetPath()
            for prim in Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies(Usd.PrimAllPrimsPredicate))
            for spec in prim.GetPrimStack()
        )


def _is_of_light(target: str, scene: Scene, stage: Usd.Stage) -> bool:
    """True of a number of one of the scene's lights, below which nothing is that it may move."""
    path, _, attribute = target.partition(".")
    is_light = attribute.startswith(ON_LIGHTS_ALONE) and any(light.name == path for light in scene.lights)
    return is_light and not stage.GetPrimAtPath(path).GetAllChildren()


def _read_lights(
    lights: Sequence[Light], context: StageContext
) -> tuple[tuple[Light, ...], tuple[tuple[str, str], ...]] | None:
    """The lights as they are now, linked as they were, and what there is to tell of them; None where one is refused."""
    policy = Policy(strict=context.policy.strict, asked_for=context.policy.asked_for)
    now = replace(context, policy=policy)  # With transforms of its own, too.
    found = []
    for light in lights:
        prim = context.stage.GetPrimAtPath(light.name)
        try:
            again = read_light(prim, now) if prim else None
        except (FgfError, Tf.ErrorException):
            return None
        if again is None:
            return None
        if light.link is not None or light.shadow_link is not None:
            again = replace(again, link=light.link, shadow_link=light.shadow_link)
        found.append(again)
    return tuple(found), policy.notes.entries()

"""Networks of shaders: what gives an input its value, through node graphs and the interfaces of materials."""

from __future__ import annotations

from dataclasses import dataclass

from pxr import Usd, UsdShade

from usd_scenes.reader.context import StageContext


@dataclass(frozen=True)
class Output:
    """What a shader gives.

    Args:
        shader: the shader.
        name: of its output.
    """

    shader: UsdShade.Shader
    name: str

    @property
    def kind(self) -> str:
        """The shader's identifier, empty where it has none."""
        return self.shader.GetShaderId() or ""


def source_of(shader: UsdShade.Shader, name: str, context: StageContext) -> Usd.Attribute | Output:
    """What gives an input its value: an attribute, undefined where there is no such input, or a shader's output.

    An input that is connected to another without a value has its own. So has one whose connection leads nowhere,
    which is named in a warning.

    Returns:
        An attribute, which may have no value, or the output of a shader that is there.

    Raises:
        SceneError: in place of the warning, where the stage is read strictly.
    """
    attribute = own_attribute(shader, name)
    if not attribute or not attribute.HasAuthoredConnections():
        return attribute
    sources = UsdShade.Utils.GetValueProducingAttributes(UsdShade.Input(attribute))
    if not sources or sources[0] == attribute:
        targets = [attribute.GetStage().GetAttributeAtPath(path) for path in attribute.GetConnections()]
        if not all(target and UsdShade.Input.IsInput(target) for target in targets):
            context.mend("connected to nothing: the input's own value is used", attribute.GetPath())
        return attribute
    source = sources[0]
    if len(sources) > 1:
        context.notes.add("connected to several: the first is used", attribute.GetPath())
    if UsdShade.Output.IsOutput(source):
        return Output(UsdShade.Shader(source.GetPrim()), UsdShade.Output(source).GetBaseName())
    return source


def value_of(shader: UsdShade.Shader, name: str, context: StageContext) -> Usd.Attribute:
    """The attribute that holds the value of an input that is the same everywhere, undefined where there is none.

    Where a shader gives it, that is named in a warning, and the input's own attribute is taken.
    """
    source = source_of(shader, name, context)
    return ignore(source, shader, name, context) if isinstance(source, Output) else source


def ignore(output: Output, shader: UsdShade.Shader, name: str, context: StageContext) -> Usd.Attribute:
    """An input's own attribute, with a warning that the output it is connected to cannot be rendered there."""
    attribute = own_attribute(shader, name)
    kind = output.kind or "a shader without an identifier"
    text = f"connected to {output.name} of {kind}, which is not rendered here: the input's own value is used"
    context.notes.add(text, attribute.GetPath())
    return attribute


def own_attribute(shader: UsdShade.Shader, name: str) -> Usd.Attribute:
    """The attribute of an input, whatever it is connected to; undefined where there is no such input."""
    return shader.GetPrim().GetAttribute(f"{UsdShade.Tokens.inputs}{name}")


def primvar_name(reader: UsdShade.Shader, context: StageContext) -> str:
    """The primvar that a UsdPrimvarReader reads; empty, with a warning, where it names none."""
    attribute = value_of(reader, "varname", context)
    name = attribute.Get(context.time) if attribute else None
    if not name:
        context.mend("names no primvar", f"{reader.GetPath()}.inputs:varname")
    return str(name or "")

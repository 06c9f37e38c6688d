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

    A connection that leads to no value is named in a warning, and the input's own attribute is taken.
    """
    attribute = own_attribute(shader, name)
    if not attribute or not attribute.HasAuthoredConnections():
        return attribute
    sources = UsdShade.Utils.GetValueProducingAttributes(UsdShade.Input(attribute))
    if len(sources) != 1 or sources[0] == attribute:
        context.notes.add("connected to nothing that has a value: its own is used", attribute.GetPath())
        return attribute
    (source,) = sources
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
        context.note_missing("names no primvar", f"{reader.GetPath()}.inputs:varname")
    return str(name or "")

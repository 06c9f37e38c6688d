"""Copies of stages that need nothing beside them: what is read of a copy is what is read of the stage."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from pxr import Sdf, Usd

from fgf_warp.errors import SceneError
from generators.planning.digest import canonical, content_hash
from tests.usd.pictures import noise, write_picture
from usd_scenes.localizing import StageFiles, stage_file_name
from usd_scenes.reader import read_scene

ASSETS = Path(__file__).parents[3] / "shared" / "usd_assets"
SUFFIXES = {".usd", ".usda", ".usdc", ".usdz"}
FILES = sorted(path for path in ASSETS.rglob("*") if path.suffix in SUFFIXES) if ASSETS.is_dir() else []

ROOT = """#usda 1.0
(
    defaultPrim = "World"
    metersPerUnit = 1
    upAxis = "Y"
    startTimeCode = 3
    subLayers = [
        @./layers/sky.usda@ (offset = 2),
        @`"./layers/${WHICH}.usda"`@
    ]
    expressionVariables = {
        string WHICH = "camera"
    }
)
def Xform "World"
{
    def Xform "Set" (
        prepend references = @../props/quad.usda@
        variants = {
            string look = "painted"
        }
        prepend variantSets = "look"
    )
    {
        variantSet "look" = {
            "painted" {
            }
            "tiled" (
                prepend payload = @../props/tiled.usdc@
            ) {
            }
            "packed" (
                prepend references = @../packed.usdz@
            ) {
            }
        }
    }
    def Xform "Moving" (
        clips = {
            dictionary default = {
                string templateAssetPath = "./clips/move.#.usda"
                double templateStartTime = 1
                double templateEndTime = 3
                double templateStride = 1
                string primPath = "/Clip"
                asset manifestAssetPath = @./clips/manifest.usda@
            }
        }
    )
    {
        double3 xformOp:translate
        uniform token[] xformOpOrder = ["xformOp:translate"]
        def Sphere "Ball"
        {
        }
    }
    def Xform "Odd"
    {
        asset[] notes = [@../secret.txt@, @@, @../gone.png@, @./not.there.<UDIM>.png@]
        asset climbing = @../../../../../../../../etc/passwd@
        asset device = @/dev/zero@
    }
}
"""
SKY = """#usda 1.0
over "World"
{
    def DomeLight "Sky"
    {
        asset inputs:texture:file = @../images/sky.exr@
        float inputs:intensity.timeSamples = { 1: 1, 5: 9 }
    }
}
"""
CAMERA = """#usda 1.0
over "World"
{
    def Camera "Camera"
    {
        double3 xformOp:translate = (0, 0, 9)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
}
"""
QUAD = """#usda 1.0
(
    defaultPrim = "Prop"
)
def Xform "Prop"
{{
    def Mesh "Quad" (
        prepend apiSchemas = ["MaterialBindingAPI"]
    )
    {{
        rel material:binding = <../Paint>
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
        texCoord2f[] primvars:st = [(0, 0), (2, 0), (2, 1), (0, 1)] (
            interpolation = "vertex"
        )
        uniform token subdivisionScheme = "none"
    }}
    def Material "Paint"
    {{
        token outputs:surface.connect = <Surface.outputs:surface>
        def Shader "Surface"
        {{
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor.connect = <../Picture.outputs:rgb>
            token outputs:surface
        }}
        def Shader "Picture"
        {{
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @{picture}@
            float2 inputs:st.connect = <../Place.outputs:result>
            float3 outputs:rgb
        }}
        def Shader "Place"
        {{
            uniform token info:id = "UsdPrimvarReader_float2"
            string inputs:varname = "st"
            float2 outputs:result
        }}
    }}
}}
"""
LOOKS = ("painted", "tiled", "packed")


def write_stage(folder: Path) -> Path:
    """A stage of every kind of file, whose folders hold files of equal names; returns the path of its root."""
    (folder / "shot/layers").mkdir(parents=True)
    (folder / "shot/clips").mkdir()
    (folder / "shot/images").mkdir()
    (folder / "props/tex").mkdir(parents=True)
    (folder / "shot/root.usda").write_text(ROOT)
    (folder / "shot/layers/sky.usda").write_text(SKY)
    (folder / "shot/layers/camera.usda").write_text(CAMERA)
    (folder / "secret.txt").write_text("a password")
    for time in (1, 2, 3):
        moved = f"double3 xformOp:translate.timeSamples = {{ {time}: ({time}, 0, 0) }}"
        (folder / f"shot/clips/move.{time}.usda").write_text(f'#usda 1.0\ndef "Clip"\n{{\n{moved}\n}}\n')
    manifest = '#usda 1.0\ndef "Clip"\n{\n    double3 xformOp:translate\n}\n'
    (folder / "shot/clips/manifest.usda").write_text(manifest)
    write_picture(folder / "shot/images/sky.exr", noise(3, np.float32))
    (folder / "props/quad.usda").write_text(QUAD.format(picture="tex/paint.png"))
    write_picture(folder / "props/tex/paint.png", noise(3, seed=2))
    tiled = Sdf.Layer.CreateAnonymous(".usdc")
    tiled.ImportFromString(QUAD.format(picture="./tex/paint.<UDIM>.png"))
    tiled.Export(str(folder / "props/tiled.usdc"))
    for tile in (1001, 1002):
        write_picture(folder / f"props/tex/paint.{tile}.png", noise(3, seed=tile))
    (folder / "inside.usda").write_text(QUAD.format(picture="paint.png"))
    write_picture(folder / "paint.png", noise(3, seed=3))
    package = Sdf.ZipFileWriter.CreateNew(str(folder / "packed.usdz"))
    for name in ("inside.usda", "paint.png"):
        package.AddFile(str(folder / name), name)
        (folder / name).unlink()
    package.Save()
    return folder / "shot/root.usda"


def copied(stages: dict[str, Path], folder: Path) -> dict[str, bytes]:
    """What the copy of stages in a new folder holds."""
    folder.mkdir()
    files = StageFiles(stages)
    files.write(folder)
    assert files.names == tuple(sorted(path.name for path in folder.iterdir()))
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def read_hash(path: Path, **asked) -> str:
    return content_hash(canonical(read_scene(path, **asked).scene))


def scenes(path: Path) -> list[str]:
    """What the stage comes to: with each variant, and at a frame of another clip and another light."""
    return [*(read_hash(path, edits={"/World/Set{look}": look}) for look in LOOKS), read_hash(path, frame=1)]


def test_a_copy_is_read_as_the_stage_is_and_holds_all_variants(tmp_path):
    root = write_stage(tmp_path / "original")
    expected = scenes(root)
    assert len(set(expected)) == len(LOOKS) + 1
    copied({"root.usda": root}, tmp_path / "copy")
    shutil.rmtree(tmp_path / "original")
    assert scenes(tmp_path / "copy" / "root.usda") == expected


def test_every_file_has_a_harmless_name_in_one_folder(tmp_path):
    copy = copied({"root.usda": write_stage(tmp_path / "original")}, tmp_path / "copy")
    pictures = {"sky.exr", "paint.png", "paint.1001.png", "paint.1002.png", "paint-2.png"}
    clips = {"move.1.usda", "move.2.usda", "move.3.usda", "manifest.usda"}
    assert set(copy) == {
        "root.usda",
        "sky.usda",
        "camera.usda",
        "quad.usda",
        "tiled.usdc",
        "packed.usd",
        *clips,
        *pictures,
    }
    root = Sdf.Layer.FindOrOpen(str(tmp_path / "copy" / "root.usda"))
    assert list(root.subLayerPaths) == ["./sky.usda", "./camera.usda"]
    assert [offset.offset for offset in root.subLayerOffsets] == [2, 0]
    assert b"a password" not in b"".join(copy.values())
    assert b"root:" not in b"".join(copy.values())
    odd = root.GetPrimAtPath("/World/Odd").attributes
    assert odd["climbing"].default.path == "./missing/passwd"
    assert odd["device"].default.path == "./missing/zero"
    assert "./missing/gone.png" in [path.path for path in odd["notes"].default]


def test_a_copy_of_a_copy_and_one_made_elsewhere_are_the_same_bytes(tmp_path):
    root = write_stage(tmp_path / "original")
    copy = copied({"root.usda": root}, tmp_path / "copy")
    assert copied({"root.usda": tmp_path / "copy" / "root.usda"}, tmp_path / "again") == copy
    shutil.copytree(tmp_path / "original", tmp_path / "some where/else")
    made = tmp_path / "made"
    made.mkdir()
    code = (
        "import sys; from pathlib import Path; from usd_scenes.localizing import StageFiles; "
        "StageFiles({'root.usda': sys.argv[1]}).write(Path(sys.argv[2]))"
    )
    command = [sys.executable, "-c", code, str(tmp_path / "some where/else/shot/root.usda"), str(made)]
    subprocess.run(command, check=True, env={**os.environ, "PYTHONHASHSEED": "7"})
    assert {path.name: path.read_bytes() for path in made.iterdir()} == copy


def test_stages_share_what_they_are_made_of(tmp_path):
    root = write_stage(tmp_path / "original")
    # It has no variables, of which paths in the layer might be made; so the layer is not the one of the other stage.
    other = tmp_path / "original/quad.usda"
    other.write_text("#usda 1.0\n(\n    subLayers = [@./props/quad.usda@]\n)\n")
    copy = copied({"root.usda": root, "quad.usda": other}, tmp_path / "copy")
    assert {"quad.usda", "quad-2.usda"} <= set(copy)
    assert b"@./quad-3.usda@" in copy["quad.usda"]
    assert sum(name.startswith("paint") for name in copy) == 4


def test_a_package_is_a_layer_and_its_pictures(tmp_path):
    write_stage(tmp_path / "original")
    name = stage_file_name("packed.usdz")
    copy = copied({name: tmp_path / "original/packed.usdz"}, tmp_path / "copy")
    assert set(copy) == {"packed.usd", "paint.png"}
    assert read_hash(tmp_path / "copy" / name) == read_hash(tmp_path / "original/packed.usdz")


def test_names_without_harm_and_of_any_case(tmp_path):
    """Of files whose names hold anything, or differ in the case of letters alone."""
    names = ("a b;$(x).png", "A B;$(X).png", ".hidden.png", "ä.png", "x" * 240 + ".png")
    paths = ", ".join(f"@./{name}@" for name in names)
    (tmp_path / "s.usda").write_text(f'#usda 1.0\ndef "A"\n{{\n    asset[] all = [{paths}]\n}}\n')
    for name in names:
        write_picture(tmp_path / "s.png", noise(3)).rename(tmp_path / name)
    copy = copied({"s.usda": tmp_path / "s.usda"}, tmp_path / "copy")
    assert set(copy) == {"s.usda", "a_b_x_.png", "A_B_X_-2.png", "hidden.png", "_.png", "x" * 100 + ".png"}


def test_what_a_variable_names_depends_on_who_asks(tmp_path):
    (tmp_path / "s.usda").write_text(
        '#usda 1.0\n(\n expressionVariables = {\n string W = "one"\n }\n)\n'
        'def "A" (\n references = @./asked.usda@\n)\n{\n}\n'
    )
    (tmp_path / "asked.usda").write_text(
        '#usda 1.0\n(\n defaultPrim = "B"\n expressionVariables = {\n string W = "two"\n }\n)\n'
        'def "B" (\n references = @`"./${W}.usda"`@\n)\n{\n}\n'
    )
    for name in ("one", "two"):
        (tmp_path / f"{name}.usda").write_text(
            f'#usda 1.0\n(\n defaultPrim = "C"\n)\ndef "C"\n{{\n string found = "{name}"\n}}\n'
        )
    copied({name: tmp_path / name for name in ("s.usda", "asked.usda")}, tmp_path / "copy")
    for folder in (tmp_path, tmp_path / "copy"):
        for name, prim, expected in (("s.usda", "/A", "one"), ("asked.usda", "/B", "two")):
            stage = Usd.Stage.Open(str(folder / name))
            assert stage.GetPrimAtPath(prim).GetAttribute("found").Get() == expected


def test_a_stage_that_is_not_there_is_told(tmp_path):
    with pytest.raises(SceneError, match=r"gone\.usda"):
        StageFiles({"gone.usda": tmp_path / "gone.usda"})


@pytest.mark.skipif(not FILES, reason="the third-party stages of ../shared/usd_assets are not here")
@pytest.mark.parametrize("path", FILES, ids=lambda path: "/".join(path.parts[-2:]))
def test_third_party_stages_are_read_of_their_copies(path, tmp_path, capfd):
    name = stage_file_name(path.name)
    copied({name: path}, tmp_path / "copy")
    found, expected = read_scene(tmp_path / "copy" / name), read_scene(path)
    assert content_hash(canonical(found.scene)) == content_hash(canonical(expected.scene))
    assert len(found.warnings) == len(expected.warnings)
    assert capfd.readouterr() == ("", "")

"""What USD would print of a damaged file, or say on a thread of its own, is a warning or a refusal that names it."""

from __future__ import annotations

import sys
from pathlib import Path
from threading import Thread

import pytest
from pxr import Sdf, Tf

from fgf_warp.errors import SceneError
from tests.usd.prims import CAMERA, DOME, HEADER
from usd_scenes.reader import read_scene
from usd_scenes.reader.listening import listening
from usd_scenes.validation.run import validate_stage

STANDS_FOR_NO_TEXT = b"~no~"
NO_TEXT = "holds text that is not UTF-8, as of a damaged file; no value is used"


def write_damaged(folder: Path, prims: str, camera: str = CAMERA) -> Path:
    """A binary stage in which each ``~no~`` begins with a byte that begins no letter."""
    layer = Sdf.Layer.CreateAnonymous(".usda")
    assert layer.ImportFromString(HEADER + camera + DOME + prims)
    path = folder / "stage.usdc"
    layer.Export(str(path))
    content = path.read_bytes()
    assert STANDS_FOR_NO_TEXT in content
    path.write_bytes(content.replace(STANDS_FOR_NO_TEXT, b"\xbeno~"))
    return path


@pytest.mark.parametrize(
    ("prims", "attribute"),
    [
        ('def Mesh "M" {\n uniform token orientation = "left~no~"\n}', "/M.orientation"),
        ('def Mesh "M" {\n uniform token subdivisionScheme = "~no~"\n}', "/M.subdivisionScheme"),
        (
            'def RenderSettings "R" {\n uniform token aspectRatioConformPolicy = "~no~"\n}',
            "/R.aspectRatioConformPolicy",
        ),
    ],
)
def test_a_value_that_is_no_text_is_named_and_not_printed(prims: str, attribute: str, tmp_path: Path, capfd) -> None:
    reading = read_scene(write_damaged(tmp_path, prims))
    assert f"{attribute} {NO_TEXT}" in reading.warnings
    assert capfd.readouterr().err == ""


def test_a_value_that_is_no_text_is_refused_strictly(tmp_path: Path) -> None:
    camera = CAMERA.replace("{", '{\n    token projection = "ort~no~"', 1)
    path = write_damaged(tmp_path, "", camera)
    with pytest.raises(SceneError, match=r"\.projection holds text that is not UTF-8"):
        read_scene(path, strict=True)
    assert any("projection holds" in warning for warning in read_scene(path).warnings)


@pytest.mark.parametrize(
    "prim",
    [
        'def Sphere "S" (\n prepend apiSchemas = ["CollectionAPI:c~no~"]\n) {\n}',
        'def Sphere "S" {\n uniform token[] xformOpOrder = ["xformOp:~no~"]\n}',
    ],
)
def test_a_name_that_is_no_text_is_refused_in_a_line(prim: str, tmp_path: Path, capfd) -> None:
    path = write_damaged(tmp_path, prim)
    with pytest.raises(SceneError, match=r"stage\.usdc: the file is damaged: a name in it is no text"):
        read_scene(path)
    errors = [finding.text for finding in validate_stage(path).findings if finding.severity == "error"]
    assert errors == ["the file is damaged: a name in it is no text"]
    assert capfd.readouterr().err == ""


def test_what_usd_says_on_another_thread_is_heard(capfd) -> None:
    with listening() as heard:
        for said in ("one", "two"):
            thread = Thread(target=Tf.Warn, args=(said,))
            thread.start()
            thread.join()
        assert heard.warnings() == ["one", "two"]
        assert heard.warnings() == ["one", "two"]
    assert capfd.readouterr().err == ""


def test_other_errors_that_are_printed_go_where_they_went(capfd) -> None:
    hook = sys.excepthook
    with listening() as heard:
        sys.excepthook(ValueError, ValueError("another"), None)
        assert heard.no_text == []
    assert sys.excepthook is hook
    assert "another" in capfd.readouterr().err

"""Datasets hold their stages: moved elsewhere, without what they were made of, they are made to the same bytes."""

import os
import random
import shutil
import signal
import subprocess
import sys
import threading
import time
import uuid
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from pxr import Sdf
from typer.testing import CliRunner

from fgf_warp.errors import ConfigError, CorruptFileError, OutputError
from generators.checking.findings import Kind
from generators.checking.verify import verify_dataset
from generators.cli import app
from generators.dataset import layout, scene_files
from generators.dataset.plan_table import read_plan, write_plan
from generators.dataset.reader import Dataset
from generators.dataset.record import SceneRecord, decode_scene_record, encode, file_entry
from generators.dataset.store import Store
from generators.planning.document import load_config
from generators.planning.plan import build_plan
from generators.publishing.publish import publish
from generators.running import stages
from generators.running.run import generate
from generators.running.shard import Shard
from tests.generators.small_plan import NOT_EQUAL, STAGE
from tests.usd.pictures import noise, write_picture

REPOSITORY = Path(__file__).resolve().parents[2]
ROOT = """#usda 1.0
(
    defaultPrim = "World"
    metersPerUnit = 1
    upAxis = "Y"
    subLayers = [@./layers/light.usda@, @./sphere.usda@]
)
over "World" (
    variants = {
        string fog = "thin"
    }
    prepend variantSets = "fog"
)
{
    over "Looks" (
        prepend references = @./props/floor.usdz@
    )
    {
    }
    variantSet "fog" = {
        "thin" (
            prepend references = @./props/thin.usda@
        ) {
        }
        "thick" (
            prepend references = @./props/thick.usda@
        ) {
        }
    }
}
"""
LIGHT = """#usda 1.0
over "World"
{
    over "Environment"
    {
        asset inputs:texture:file = @../images/sky.png@
    }
}
"""
FLOOR = """#usda 1.0
(
    defaultPrim = "Floor"
)
def Scope "Floor"
{
    def DomeLight "Fill"
    {
        float inputs:intensity = 0.5
        asset inputs:texture:file = @fill.png@
    }
}
"""
FOG = """#usda 1.0
(
    defaultPrim = "Fog"
)
def Xform "Fog"
{{
    over "Looks"
    {{
        over "Medium"
        {{
            color3f inputs:fgf:extinctionColor = ({share}, {share}, {share})
        }}
    }}
}}
"""
CONFIG = """\
# A small one.
name: own
scene: shot/stage.usda
seed: 7
image: {width: 16, height: 16}
spp: 4
axes:
  H: [-0.4, -0.25]
  fog: {target: "/World{fog}", values: [thin, thick]}
"""
SAMPLES = tuple(f"data/train/00000{index}" for index in range(4))


def write_project(folder: Path) -> Path:
    """A config beside its stage, which is made of layers, a package and pictures; returns the path of the config."""
    for name in ("layers", "images", "props"):
        (folder / "shot" / name).mkdir(parents=True)
    shutil.copyfile(STAGE, folder / "shot/sphere.usda")
    (folder / "shot/stage.usda").write_text(ROOT)
    (folder / "shot/layers/light.usda").write_text(LIGHT)
    write_picture(folder / "shot/images/sky.png", noise(3))
    for name, share in (("thin", 0.25), ("thick", 1.5)):
        (folder / f"shot/props/{name}.usda").write_text(FOG.format(share=share))
    (folder / "floor.usda").write_text(FLOOR)
    write_picture(folder / "fill.png", noise(3, seed=2))
    package = Sdf.ZipFileWriter.CreateNew(str(folder / "shot/props/floor.usdz"))
    for name in ("floor.usda", "fill.png"):
        package.AddFile(str(folder / name), name)
        (folder / name).unlink()
    package.Save()
    (folder / "own.yaml").write_text(CONFIG)
    return folder / "own.yaml"


def make(config: Path, location, **options):
    loaded = load_config(config)
    return generate(build_plan(loaded), loaded.to_bytes(), location, **options)


def content(location: Path | str) -> dict[str, bytes]:
    """What two datasets of one plan have in common, the config and the stage among it."""
    store = Store(location)
    names = [name for name in store.sizes() if not name.startswith(f"{layout.RUN}/")]
    return {
        name: store.read(name)
        for name in names
        if name.rpartition("/")[2] not in NOT_EQUAL - {layout.CONFIG} and name != layout.REPORT
    }


def fgf(*arguments, code: int = 0) -> str:
    outcome = CliRunner().invoke(app, [str(argument) for argument in arguments])
    assert outcome.exit_code == code, outcome.output
    return outcome.output


def flip(data: bytes) -> bytes:
    changed = bytearray(data)
    changed[random.Random(len(data)).randrange(len(data))] ^= 4
    return bytes(changed)


@pytest.fixture(scope="module")
def rendered(tmp_path_factory):
    """Four samples; the stage is gone since."""
    folder = tmp_path_factory.mktemp("rendered")
    fgf("generate", write_project(folder / "project"), "--out", folder / "own")
    shutil.rmtree(folder / "project")
    return folder / "own"


@pytest.fixture
def moved(rendered, tmp_path):
    return shutil.copytree(rendered, tmp_path / "elsewhere" / "moved")


def test_a_dataset_holds_all_that_its_stage_is_made_of(moved):
    names = {path.name for path in (moved / layout.SCENE).iterdir()}
    layers = {"stage.usda", "light.usda", "sphere.usda", "thin.usda", "thick.usda", "floor.usd"}
    assert names == {"files.json", "sky.png", "fill.png", *layers}
    config = (moved / layout.CONFIG).read_text()
    assert config.startswith("# scene/stage.usda was 'shot/stage.usda'\n# A small one.\n")
    assert "scene: scene/stage.usda\n" in config
    images = [(moved / sample / layout.RADIANCE).read_bytes() for sample in SAMPLES]
    assert len(set(images)) == len(images)
    assert len({sample.scene for sample in build_plan(load_config(moved / layout.CONFIG)).samples}) == 2


def test_a_moved_dataset_goes_on_and_heals_without_the_stage_it_was_made_of(moved, tmp_path):
    before = content(moved)
    assert "all is as it should be" in fgf("verify", moved, "--deep")
    shutil.rmtree(moved / SAMPLES[1])
    shutil.rmtree(moved / SAMPLES[2])
    assert "2 of 4 samples rendered" in fgf("generate", moved)
    assert content(moved) == before
    image = moved / SAMPLES[3] / layout.RADIANCE
    image.write_bytes(flip(image.read_bytes()))
    assert "rendered sample 3 again" in fgf("verify", moved, "--repair")
    assert content(moved) == before
    (moved / layout.PLAN).unlink()
    fgf("verify", moved, "--repair")
    assert content(moved) == before
    fgf("generate", moved / layout.CONFIG, "--out", tmp_path / "again")
    assert content(tmp_path / "again") == before
    assert "sweeping H, fog, of stage.usda" in fgf("validate", moved / layout.CONFIG)
    assert "4 of 4 samples are there" in fgf("status", moved)
    fgf("plan", moved)
    fgf("report", moved)
    fgf("export", "npz", moved, "--out", tmp_path / "arrays")


def test_an_object_store_holds_it_too(moved):
    url = f"memory://{uuid.uuid4().hex}"
    for path in moved.rglob("*"):
        if path.is_file():
            Store(url).write(str(path.relative_to(moved)), path.read_bytes())
    before = content(url)
    assert "all is as it should be" in fgf("verify", url, "--deep")
    Store(url).remove(SAMPLES[1])
    fgf("generate", url)
    assert content(url) == before
    Store(url).write(f"{SAMPLES[3]}/{layout.RADIANCE}", b"nothing")
    fgf("verify", url, "--repair")
    assert content(url) == before
    Store(url).write(layout.scene_file("sky.png"), flip(before[layout.scene_file("sky.png")]))
    assert "scene/sky.png: sha256" in fgf("verify", url, code=4)
    scene_files._copied.cache_clear()  # a new process has no copy from before
    assert "is damaged; fgf generate with the config" in fgf("generate", url, code=4)


def test_in_an_object_store_it_is_written_as_in_a_folder(moved, tmp_path, fake_renderer):
    url, config = f"memory://{uuid.uuid4().hex}", write_project(tmp_path / "project")
    make(config, url, shard=Shard(0, 2))
    make(config, url)
    of_stage = {name: data for name, data in content(moved).items() if name.startswith((layout.SCENE, layout.CONFIG))}
    assert {name: Store(url).read(name) for name in of_stage} == of_stage


def test_where_the_stage_lies_is_of_no_effect_on_the_plan(tmp_path):
    plans = [build_plan(load_config(write_project(tmp_path / name))) for name in ("here", "some where/else")]
    assert plans[0].to_bytes() == plans[1].to_bytes()


def test_a_stage_that_has_changed_is_another_dataset(tmp_path, fake_renderer):
    config = write_project(tmp_path)
    make(config, tmp_path / "data")
    before = content(tmp_path / "data")
    write_picture(tmp_path / "shot/images/sky.png", noise(3, seed=9))
    with pytest.raises(ConfigError, match=r"holds a dataset of another plan \(config, scene or version differ\)"):
        make(config, tmp_path / "data")
    assert content(tmp_path / "data") == before


def test_stages_that_are_swept_are_all_there(tmp_path, fake_renderer):
    config = write_project(tmp_path)
    shutil.copytree(tmp_path / "shot", tmp_path / "other")
    shutil.move(tmp_path / "other/stage.usda", tmp_path / "other/second.usda")
    write_picture(tmp_path / "other/images/sky.png", noise(3, seed=9))
    text = CONFIG.replace("scene: shot/stage.usda\n", "") + "  scene: [shot/stage.usda, other/second.usda]\n"
    config.write_text(text)
    make(config, tmp_path / "data")
    shutil.rmtree(tmp_path / "shot")
    shutil.rmtree(tmp_path / "other")
    names = {path.name for path in (tmp_path / "data" / layout.SCENE).iterdir()}
    assert {"stage.usda", "second.usda", "sky.png", "sky-2.png", "light.usda", "light-2.usda"} <= names
    (tmp_path / "data" / "data/train/000007/record.json").unlink()
    before = {sample.scene for sample in build_plan(load_config(config_of(tmp_path / "data"))).samples}
    assert len(before) == 4
    assert make(config_of(tmp_path / "data"), tmp_path / "data").reused == 7


def config_of(folder: Path) -> Path:
    return folder / layout.CONFIG


@pytest.mark.parametrize("name", ["scene/sky.png", "scene/thin.usda", "scene/files.json"])
@pytest.mark.parametrize("damage", ["flip", "delete"])
def test_a_damaged_stage_is_named_and_comes_back_from_the_original(tmp_path, fake_renderer, name, damage):
    config, data = write_project(tmp_path), tmp_path / "data"
    make(config, data)
    before = content(data)
    if damage == "flip":
        (data / name).write_bytes(flip(before[name]))
    else:
        (data / name).unlink()
    assert f"{name}: " in fgf("verify", data, code=4)
    told = fgf("verify", data, "--repair", code=4)
    assert f"{name} cannot be made anew of the dataset alone: fgf generate with the config that" in told
    with pytest.raises((CorruptFileError, ConfigError)):
        make(config_of(data), data)
    (data / "scene/mine.txt").write_text("mine")
    make(config, data)
    assert content(data).items() >= before.items()
    assert (data / "scene/mine.txt").read_text() == "mine"
    (data / "scene/mine.txt").unlink()
    assert verify_dataset(Dataset(data)).is_whole


@pytest.mark.parametrize("name", ["../config.yaml", "/tmp/x", "a/b.png", "..", "", "a\\b"])
def test_no_dataset_names_files_outside_of_its_stage(name):
    record = encode(SceneRecord({name: file_entry(b"x")}))
    with pytest.raises(CorruptFileError, match="accepted: files of its own folder"):
        decode_scene_record(record, "files.json")


def test_what_does_not_belong_to_a_stage_is_named_and_stays(tmp_path, fake_renderer):
    data = tmp_path / "data"
    make(write_project(tmp_path), data)
    (data / "scene/mine.txt").write_text("mine")
    (finding,) = verify_dataset(Dataset(data)).findings
    assert (finding.kind, finding.name) == (Kind.SURPLUS, "scene/mine.txt")
    CliRunner().invoke(app, ["verify", str(data), "--repair"])
    assert (data / "scene/mine.txt").read_text() == "mine"


def test_a_run_that_ends_while_it_copies_leaves_nothing_that_looks_whole(tmp_path, fake_renderer, monkeypatch):
    config, data = write_project(tmp_path), tmp_path / "data"

    def full(path):
        raise OSError(28, os.strerror(28))

    with monkeypatch.context() as patch:
        patch.setattr(stages, "flush_to_disk", full)
        with pytest.raises(OutputError, match="scene: cannot be written: No space left on device"):
            make(config, data)
    assert not (data / layout.SCENE).exists()
    # As a run leaves it that is killed.
    hidden = data / ".scene.0123456789ab.partial"
    hidden.mkdir()
    (hidden / "stage.usda").write_text(ROOT)
    make(config, data)
    assert not list(data.glob(".*"))
    assert verify_dataset(Dataset(data)).is_whole


def test_it_is_copied_once(tmp_path, fake_renderer, monkeypatch):
    config, data = write_project(tmp_path), tmp_path / "data"
    make(config, data, shard=Shard(0, 2))
    monkeypatch.setattr(Store, "place", None)
    make(config, data, shard=Shard(1, 2))


def test_a_user_is_told_before_much_is_copied(tmp_path, fake_renderer, monkeypatch):
    config, told = write_project(tmp_path), []
    make(config, tmp_path / "small", tell=told.append)
    assert told == []
    monkeypatch.setattr(stages, "LARGE", 1000)
    make(config, tmp_path / "large", tell=told.append)
    (line,) = told
    assert line.endswith("GiB, which are copied into the dataset")


def test_a_dataset_of_before_is_whole_without_a_stage(tmp_path, fake_renderer):
    """Its plan is one of another version, so it is read and checked but not gone on with."""
    config, data = write_project(tmp_path), tmp_path / "data"
    make(config, data)
    meta, table = read_plan((data / layout.PLAN).read_bytes(), "plan")
    (data / layout.PLAN).write_bytes(write_plan(type(meta)(**{**vars(meta), "stages": ()}), table))
    shutil.rmtree(data / layout.SCENE)
    publish(Dataset(data))
    assert verify_dataset(Dataset(data)).is_whole


def test_pixels_of_pictures_count_and_not_their_names():
    from fgf_warp.scene import Image
    from generators.planning.digest import canonical

    pixels = np.zeros((1, 1, 4), np.uint8)
    assert canonical(Image("a", pixels)) == canonical(Image("b", pixels))
    assert canonical(Image("a", pixels)) != canonical(Image("a", pixels + 1))


def test_a_config_whose_stage_is_gone_is_told_of_the_dataset_that_holds_it(tmp_path, fake_renderer):
    config = write_project(tmp_path / "project")
    fgf("generate", config, "--out", tmp_path / "own")
    shutil.rmtree(tmp_path / "project/shot")
    said = fgf("generate", config, "--out", tmp_path / "own", code=2)
    assert f"there is no such stage; the dataset holds what it was made from: fgf generate {tmp_path / 'own'}" in said
    assert "holds" not in fgf("generate", config, "--out", tmp_path / "other", code=2)


COPIED = """
import os, signal, sys
from generators.dataset import store
from generators.cli import app
kept = store._place_folder
def place(target, hidden, last):
    if target.name == "scene":
        (hidden / last).unlink()
        os.kill(os.getpid(), signal.SIGKILL)
    kept(target, hidden, last)
store._place_folder = place
app()
"""


def test_a_run_that_is_killed_while_it_copies_is_gone_on_with(tmp_path, fake_renderer):
    config, data = write_project(tmp_path / "project"), tmp_path / "own"
    command = [sys.executable, "-c", COPIED, "generate", str(config), "--out", str(data)]
    killed = subprocess.run(command, capture_output=True, check=False, timeout=120, cwd=REPOSITORY)
    assert killed.returncode == -signal.SIGKILL
    assert not (data / "scene").exists()
    assert [path for path in data.iterdir() if path.name.startswith(".scene.")]
    fgf("generate", config, "--out", data)
    assert not [path for path in data.iterdir() if path.name.startswith(".")]
    make(config, tmp_path / "whole")
    assert content(data) == content(tmp_path / "whole")


def test_shards_that_begin_at_once_copy_the_stage_once(tmp_path, fake_renderer, monkeypatch):
    """The first is held up while it copies, and the second waits for it."""
    config, data = write_project(tmp_path / "project"), tmp_path / "own"
    begun, copies, keep = threading.Event(), [], Store.place

    def slowly(store, folder, fill, last):
        copies.append(folder)
        begun.set()
        time.sleep(0.5)
        keep(store, folder, fill, last)

    monkeypatch.setattr(Store, "place", slowly)
    with ThreadPoolExecutor(2) as pool:
        first = pool.submit(make, config, data, shard=Shard(0, 2))
        assert begun.wait(60)
        second = pool.submit(make, config, data, shard=Shard(1, 2))
        first.result(120)
        second.result(120)
    assert copies == ["scene"]
    make(config, tmp_path / "whole")
    assert content(data) == content(tmp_path / "whole")

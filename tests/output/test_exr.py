import os

import numpy as np
import OpenImageIO as oiio  # noqa: N813
import pytest

from fgf_warp.errors import CorruptFileError, OutputError
from fgf_warp.output import images
from fgf_warp.output.exr import AOV_CHANNELS, channel_names, read_exr, write_exr
from fgf_warp.settings import Aov, RenderSettings
from tests.renders import made_up_render

SETTINGS = RenderSettings(width=13, height=7, spp=3, seed=5, aovs=frozenset(Aov))


def test_every_plane_comes_back_bit_for_bit(tmp_path):
    result = made_up_render(SETTINGS)
    write_exr(tmp_path / "a.exr", result)
    channels, _ = read_exr(tmp_path / "a.exr")
    assert set(channels) == set(channel_names(Aov))
    for i, name in enumerate("RGB"):
        np.testing.assert_array_equal(channels[name], result.radiance[..., i])
        np.testing.assert_array_equal(channels[f"variance.{name}"], result.variance[..., i])
    for aov, plane in result.aovs.items():
        for i, name in enumerate(AOV_CHANNELS[aov]):
            np.testing.assert_array_equal(channels[name], plane[..., i] if plane.ndim == 3 else plane)
    np.testing.assert_array_equal(channels["A"], result.alpha)
    np.testing.assert_array_equal(channels["Z"], result.aovs[Aov.DEPTH])
    np.testing.assert_array_equal(channels["samples.Y"], np.full((7, 13), 3, np.float32))
    assert all(plane.dtype == np.float32 for plane in channels.values())


@pytest.mark.parametrize("aov", Aov)
def test_only_the_planes_asked_for_are_written(tmp_path, aov):
    settings = RenderSettings(width=4, height=4, spp=1, aovs=frozenset({aov}))
    write_exr(tmp_path / "a.exr", made_up_render(settings))
    assert set(read_exr(tmp_path / "a.exr")[0]) == {"R", "G", "B", "A", *AOV_CHANNELS[aov]}


def test_parameters_come_back_in_double_precision(tmp_path):
    parameters = {"S_w": 0.1 + 0.2, "tiny": 5e-324, "seed": 2**64 - 1, "nested": {"L": None, "list": [1, 2.5]}}
    write_exr(tmp_path / "a.exr", made_up_render(SETTINGS, **parameters))
    assert read_exr(tmp_path / "a.exr")[1].items() >= parameters.items()


def test_file_is_float32_and_zip_compressed(tmp_path):
    write_exr(tmp_path / "a.exr", made_up_render(SETTINGS))
    spec = oiio.ImageInput.open(str(tmp_path / "a.exr")).spec()
    assert str(spec.format) == "float"
    assert spec.getattribute("compression") == "zip"


def test_equal_renders_give_equal_bytes_and_others_do_not(tmp_path):
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        settings = RenderSettings(width=8, height=8, spp=1, seed=seed, aovs=frozenset(Aov))
        write_exr(tmp_path / f"{name}.exr", made_up_render(settings))
    a, b, c = ((tmp_path / f"{name}.exr").read_bytes() for name in "abc")
    assert a == b
    assert a != c


def test_truncated_file_is_refused(tmp_path):
    file = tmp_path / "a.exr"
    write_exr(file, made_up_render(SETTINGS))
    file.write_bytes(file.read_bytes()[:-40])
    with pytest.raises(CorruptFileError, match="incomplete"):
        read_exr(file)


def test_file_of_another_program_is_refused(tmp_path):
    images.write_image(tmp_path / "a.exr", np.zeros((2, 2, 1), np.float32), ("Y",), {})
    with pytest.raises(CorruptFileError, match="fgf:parameters"):
        read_exr(tmp_path / "a.exr")


@pytest.mark.parametrize("call", ["open", "write_image", "close"])
def test_failure_at_any_step_leaves_the_older_file(tmp_path, monkeypatch, call):
    class FailingOutput:
        def __init__(self, real):
            self.real = real

        def __getattr__(self, name):
            if name != call:
                return getattr(self.real, name)

            def fail(*arguments):
                getattr(self.real, name)(*arguments)
                return False

            return fail

    file = tmp_path / "a.exr"
    write_exr(file, made_up_render(SETTINGS))
    before = file.read_bytes()
    create = oiio.ImageOutput.create

    class Outputs:
        @staticmethod
        def create(name):
            return FailingOutput(create(name))

    monkeypatch.setattr(images.oiio, "ImageOutput", Outputs)
    with pytest.raises(OutputError, match="cannot be written"):
        write_exr(file, made_up_render(RenderSettings(width=2, height=2, spp=1)))
    assert file.read_bytes() == before
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.exr"]


def test_a_file_for_which_the_disk_has_no_room_is_refused(small_disk):
    """Whatever is missing of it, be it the last bytes alone, which OpenImageIO loses without a word."""
    pixels = np.random.default_rng(0).random((32, 32, 4), dtype=np.float32)
    page = os.sysconf("SC_PAGE_SIZE")
    refused = 0
    for free in range(8):
        (small_disk / "filling").write_bytes(bytes(220 * 1024 - free * page))
        try:
            images.write_image(small_disk / "a.exr", pixels, tuple("RGBA"), {"compression": "zip"})
        except OutputError as error:
            assert "No space left on device" in str(error)
            assert [file.name for file in small_disk.iterdir()] == ["filling"]
            refused += 1
        else:
            assert np.array_equal(images.read_image(small_disk / "a.exr")[0], pixels)
            (small_disk / "a.exr").unlink()
    assert 4 <= refused < 8


def test_words_of_the_library_that_are_no_text_are_told_all_the_same(tmp_path, monkeypatch):
    """It quotes bytes of the file that it cannot read."""

    own = images.oiio.geterror

    def geterror():
        own()
        return b"bad name \xa4".decode()

    monkeypatch.setattr(images.oiio, "geterror", geterror)
    (tmp_path / "a.exr").write_bytes(b"no image")
    with pytest.raises(CorruptFileError, match=r"a\.exr: cannot be read: bad name"):
        read_exr(tmp_path / "a.exr")

"""Rationale: Warp compiles its header in every process, half of a build. Expected: it is kept, whole or not at all."""

from pathlib import Path

import pytest
import warp as wp

from fgf_warp.device.options import kernel_options
from fgf_warp.headers import load_on_cpu

OPTIONS = kernel_options(meshes=False)


@wp.kernel(module="unique", module_options=OPTIONS)
def double(values: wp.array(dtype=float)):
    values[wp.tid()] = 2.0 * values[wp.tid()]


@wp.kernel(module="unique", module_options=OPTIONS)
def triple(values: wp.array(dtype=float)):
    values[wp.tid()] = 3.0 * values[wp.tid()]


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    wp.init()
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(tmp_path))
    return tmp_path


def headers(cache: Path) -> dict[str, int]:
    """Names of the folders, and when what is in them was written."""
    return {folder.name: max(file.stat().st_mtime_ns for file in folder.iterdir()) for folder in cache.glob("header_*")}


def test_a_second_kernel_is_built_with_the_header_of_the_first(cache):
    load_on_cpu(double.module)
    first = headers(cache)
    assert len(first) == 1
    assert not any(name.startswith("header_new_") for name in first)

    load_on_cpu(triple.module)

    assert headers(cache) == first
    values = wp.full(3, 7.0, dtype=float, device="cpu")
    wp.launch(triple, 3, inputs=[values], device="cpu")
    assert values.numpy().tolist() == [21.0] * 3


def test_a_build_that_fails_keeps_no_header(cache, monkeypatch):
    def fail(place: str) -> None:
        (Path(place) / "half.pch").write_bytes(b"cut off")
        raise RuntimeError("no space left on device")

    class Failing:
        options = OPTIONS

        def load(self, *_):
            from warp._src import context

            fail(context.runtime.get_clang_pch_dir())

    with pytest.raises(RuntimeError, match="no space"):
        load_on_cpu(Failing())
    assert headers(cache) == {}

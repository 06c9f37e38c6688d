"""Locks between processes, and the one around building kernels."""

import subprocess
import sys
from contextlib import contextmanager

import pytest

import fgf_warp.renderer
from fgf_warp.errors import OutputError
from fgf_warp.locks import HeldError, hold
from fgf_warp.settings import RenderSettings
from tests.scenes import furnace

HOLDER = """
import sys
from pathlib import Path
from fgf_warp.locks import hold
with hold(Path(sys.argv[1]), wait=False):
    print("held", flush=True)
    sys.stdin.read()
"""


def test_a_lock_is_held_against_other_processes_and_ends_with_them(tmp_path):
    path = tmp_path / "lock"
    command = [sys.executable, "-c", HOLDER, str(path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout.readline() == "held\n"
        with pytest.raises(HeldError), hold(path, wait=False):
            pass
        holder.kill()
        with hold(path, wait=True), pytest.raises(HeldError), hold(path, wait=False):
            pass


def test_a_lock_that_cannot_be_made_is_an_error(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="cannot be locked"), hold(tmp_path / "file" / "lock", wait=False):
        pass


def test_kernels_are_built_under_the_lock_of_their_cache(monkeypatch):
    held, built = [], []

    @contextmanager
    def note(path, *, wait):
        held.append(path.name)
        yield
        held.pop()

    build = fgf_warp.renderer.build_program

    def build_held(features):
        built.append(list(held))
        return build(features)

    monkeypatch.setattr(fgf_warp.renderer, "hold", note)
    monkeypatch.setattr(fgf_warp.renderer, "build_program", build_held)
    fgf_warp.renderer.prepare(furnace(), RenderSettings(width=4, height=4))
    assert built == [["fgf-warp.lock"]]

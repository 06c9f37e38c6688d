"""Folders in the system's temporary folder, which must not pile up."""

import subprocess
import sys

import pytest

from generators.dataset import scratch
from generators.dataset.scratch import PREFIX, scratch_folder

HOLDER = """
from generators.dataset.scratch import scratch_folder
with scratch_folder() as folder:
    (folder / "radiance.exr").write_text("half")
    print(folder, flush=True)
    input()
"""


@pytest.fixture
def temporary(tmp_path, monkeypatch):
    """The temporary folder of this process and those that it starts."""
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(scratch.tempfile, "tempdir", None)
    return tmp_path


def start():
    process = subprocess.Popen([sys.executable, "-c", HOLDER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    return process, process.stdout.readline().strip()


def test_nothing_is_left(temporary):
    with pytest.raises(RuntimeError), scratch_folder() as folder:
        assert folder.parent == temporary
        (folder / "a").write_text("")
        raise RuntimeError
    assert not list(temporary.iterdir())


def test_what_a_killed_program_left_is_swept_and_what_is_in_use_stays(temporary):
    (temporary / f"{PREFIX}of-someone-else").mkdir()
    killed, left = start()
    killed.kill()
    killed.communicate()
    assert (temporary / left / "radiance.exr").is_file()
    living, used = start()
    with scratch_folder():
        pass
    assert {path.name for path in temporary.iterdir() if path.is_dir()} == {
        f"{PREFIX}of-someone-else",
        used.rpartition("/")[2],
    }
    living.communicate("\n")
    assert [path.name for path in temporary.iterdir()] == [f"{PREFIX}of-someone-else"]

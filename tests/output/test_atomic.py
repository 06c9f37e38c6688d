import pytest

from fgf_warp.errors import OutputError
from fgf_warp.output.atomic import check_writable, replacing, sweep_partial, write_bytes


def test_nothing_is_visible_before_the_end(tmp_path):
    file = tmp_path / "a.txt"
    with replacing(file) as temporary:
        temporary.write_text("new")
        assert not file.exists()
        assert [entry.name[0] for entry in tmp_path.iterdir()] == ["."]
    assert file.read_text() == "new"
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_an_exception_leaves_the_folder_as_it_was(tmp_path, error):
    file = tmp_path / "a.txt"
    file.write_text("old")
    with pytest.raises(error), replacing(file) as temporary:
        temporary.write_text("new")
        raise error
    assert file.read_text() == "old"
    assert list(tmp_path.iterdir()) == [file]


def test_an_error_of_the_system_becomes_an_output_error(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match=r"file.a\.txt: cannot be written"):
        write_bytes(tmp_path / "file" / "a.txt", b"")


def test_leftovers_are_swept_and_nothing_else(tmp_path):
    for name in (".000001.0123456789ab.partial.exr", "a.exr", ".hidden", ".notes.partial.txt"):
        (tmp_path / name).write_text("")
    sweep_partial(tmp_path)
    assert sorted(entry.name for entry in tmp_path.iterdir()) == [".hidden", ".notes.partial.txt", "a.exr"]


def test_writable_names_are_told_from_others(tmp_path):
    check_writable(tmp_path / "a.exr")
    assert not list(tmp_path.iterdir())
    (tmp_path / "file").write_text("")
    for path, reason in (
        (tmp_path, "is a folder"),
        (tmp_path / "missing" / "a.exr", "there is no folder"),
        (tmp_path / "file" / "a.exr", "there is no folder"),
    ):
        with pytest.raises(OutputError, match=reason):
            check_writable(path)

"""Where what is not of a dataset goes, when it stands where something of the dataset is to be."""

from __future__ import annotations

from itertools import count
from pathlib import Path

ASIDE = ".aside"
"""End of its new name; ``fgf verify`` then tells of it as of everything that is not of the dataset."""


def move_aside(path: Path) -> None:
    """Gives a file or folder another name beside its own; an empty folder goes, and nothing at all is no matter.

    Args:
        path: of the file or folder.

    Raises:
        OSError: where it cannot be moved.
    """
    if not path.exists() and not path.is_symlink():
        return
    if path.is_dir() and not path.is_symlink() and not any(path.iterdir()):
        path.rmdir()
        return
    names = (path.with_name(f"{path.name}{ASIDE}{number or ''}") for number in count())
    path.rename(next(name for name in names if not name.exists() and not name.is_symlink()))

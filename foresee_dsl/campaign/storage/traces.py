"""Traces as files that are named by what is in them: written whole, never changed, and checked when read."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from pathlib import Path

from foresee_dsl.files import read_outside, replacing

_SUFFIX = ".npz"


def name_of(data: bytes) -> str:
    """Return the name that bytes have as a blob: the 64 hexadecimal digits of their SHA-256."""
    return hashlib.sha256(data).hexdigest()


class Blobs:
    """A folder of blobs, in up to 256 folders by the first two digits of their names."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def path(self, name: str) -> Path:
        """Return where a blob is, or would be."""
        return self.folder / name[:2] / f"{name}{_SUFFIX}"

    def put(self, data: bytes) -> str:
        """Write a blob, unless it is there, and return its name; when this returns it is on the disk.

        Raises:
            OSError: it cannot be written; nothing of it is left.
        """
        name = name_of(data)
        path = self.path(name)
        if self.get(name) is not None:  # a damaged one is written again
            return name
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as temporary, temporary.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        return name

    def get(self, name: str) -> bytes | None:
        """Return a blob's bytes, or None where it is not there or is damaged."""
        try:
            data = read_outside(self.path(name), "trace")
        except OSError:
            return None
        return data if name_of(data) == name else None

    def has(self, name: str) -> bool:
        """Return whether there is a blob of this name; what is in it is only checked when it is read."""
        return self.path(name).is_file()

    def files(self) -> Iterator[tuple[str, Path]]:
        """Yield the name and the file of each blob, and of what a killed process left half-written (name "")."""
        if not self.folder.is_dir():
            return
        for group in sorted(self.folder.iterdir()):
            for file in sorted(group.iterdir()) if group.is_dir() else ():
                yield ("" if file.name.startswith(".") else file.name.removesuffix(_SUFFIX)), file

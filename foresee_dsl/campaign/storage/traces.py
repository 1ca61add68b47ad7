"""Traces as files named by their content's hash: written whole, never changed, and checked when read."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path

from foresee_dsl.files import read_outside, replacing

_SUFFIX = ".npz"


def name_of(data: bytes) -> str:
    """Return the name of a blob: the 64 hexadecimal digits of its SHA-256."""
    return hashlib.sha256(data).hexdigest()


class Blobs:
    """A folder of blobs, in up to 256 subfolders by the first two digits of their names."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def path(self, name: str) -> Path:
        """Return the path of a blob, whether it exists or not."""
        return self.folder / name[:2] / f"{name}{_SUFFIX}"

    def put(self, data: bytes) -> str:
        """Write a blob, unless it exists, and return its name.

        It survives the end of any process. A power cut may leave it empty or cut off, which its name then shows.

        Raises:
            OSError: it cannot be written; no part of it remains.
        """
        name = name_of(data)
        path = self.path(name)
        if self.get(name) is not None:  # a damaged blob is written again
            return name
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as temporary:
            temporary.write_bytes(data)
        return name

    def get(self, name: str) -> bytes | None:
        """Return a blob's bytes, or None if it is missing or damaged."""
        try:
            data = read_outside(self.path(name), "trace")
        except OSError:
            return None
        return data if name_of(data) == name else None

    def has(self, name: str) -> bool:
        """Return whether a blob of this name exists; its content is checked only when it is read."""
        return self.path(name).is_file()

    def files(self) -> Iterator[tuple[str, Path]]:
        """Yield name and file of each blob, and of files that a killed process left half-written (name "")."""
        if not self.folder.is_dir():
            return
        for group in sorted(self.folder.iterdir()):
            for file in sorted(group.iterdir()) if group.is_dir() else ():
                yield ("" if file.name.startswith(".") else file.name.removesuffix(_SUFFIX)), file

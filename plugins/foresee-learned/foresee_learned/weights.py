"""Finds the weights of the learned drivers, and checks that the files are the trained ones.

They come with the package, with their SHA-256 in `weights/SHA256SUMS`. The environment variable `FORESEE_WEIGHTS` names
a folder to use instead; if that has no `SHA256SUMS`, its files are used without a check.
"""

from __future__ import annotations

import hashlib
import os
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

from foresee_dsl.errors import DriverError, DriverUnavailableError

FOLDER_VARIABLE = "FORESEE_WEIGHTS"
SUMS = "SHA256SUMS"
"""Name of the file of hashes, in the format of the program `sha256sum`: a line for each file, with its hash, two
blanks, and its name."""
_BUNDLED = Path(__file__).parent / "weights"
_SHORT = 8
"""Number of hexadecimal digits of a hash in texts; keys contain all of them. Ours."""


class Weights(NamedTuple):
    """A checked file of weights: its path, its SHA-256, and whether `SHA256SUMS` names it."""

    file: Path
    sha256: str
    named: bool = True

    @property
    def short(self) -> str:
        """Return the beginning of the hash."""
        return self.sha256[:_SHORT]

    def content(self) -> bytes:
        """Read the file.

        Raises:
            DriverError: its content has changed since it was checked.
        """
        content = self.file.read_bytes()
        if (digest := hashlib.sha256(content).hexdigest()) != self.sha256:
            raise _damaged(self.file, digest, self.sha256)
        return content


def find_weights(driver: str) -> Weights:
    """Return the weights of a driver, checked.

    Raises:
        DriverUnavailableError: there are none. DriverError: they are not those that `SHA256SUMS` names.
    """
    chosen = os.environ.get(FOLDER_VARIABLE)
    file = Path(chosen or _BUNDLED) / f"{driver}.onnx"
    try:
        return checked(file, sums_needed=not chosen)
    except FileNotFoundError:
        mend = (
            f"set {FOLDER_VARIABLE} to a folder with {file.name}, or unset it"
            if chosen
            else "reinstall foresee-learned"
        )
        raise DriverUnavailableError(f"the driver {driver} has no weights, there is no {file}: {mend}") from None


def checked(file: Path, *, sums_needed: bool = True) -> Weights:
    """Return a file of weights, checked against the `SHA256SUMS` beside it.

    Raises:
        FileNotFoundError: there is no such file, or no `SHA256SUMS` where one is needed. DriverError: it is not the
            file that `SHA256SUMS` names.
    """
    facts = file.stat()
    wanted = _wanted(file, sums_needed)
    digest = _sha256(file, facts.st_size, facts.st_mtime_ns)
    if wanted is not None and digest != wanted:
        raise _damaged(file, digest, wanted)
    return Weights(file, digest, wanted is not None)


def _wanted(file: Path, sums_needed: bool) -> str | None:
    """Return the hash that a file should have; None if the file is in the user's own folder, which has no hash
    for it.
    """
    sums = file.with_name(SUMS)
    if not sums_needed and not sums.exists():
        return None
    lines = (line.split(maxsplit=1) for line in sums.read_text(encoding="utf-8").splitlines())
    hashes = {words[1].lstrip("*"): words[0] for words in lines if len(words) > 1}
    if file.name not in hashes:
        raise DriverError(f"{sums} has no line for {file.name}: write one with `sha256sum {file.name} >> {SUMS}`")
    return hashes[file.name]


def _damaged(file: Path, digest: str, wanted: str) -> DriverError:
    return DriverError(
        f"{file} is not the file that was trained: its SHA-256 is {digest[:_SHORT]}..., {SUMS} beside it states "
        f"{wanted[:_SHORT]}...; reinstall the package that contains it, or export the file again"
    )


@lru_cache(maxsize=8)
def _sha256(file: Path, size: int, changed_ns: int) -> str:  # noqa: ARG001 - a file that was written anew is read again
    """Return the hash of a file; cached, because a worker creates a driver for each run, and hashing 8 MB takes some
    milliseconds.
    """
    return hashlib.sha256(file.read_bytes()).hexdigest()

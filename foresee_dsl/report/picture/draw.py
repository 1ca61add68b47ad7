"""Draws the file or case of an address, for the command line, the live page and the language server."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from foresee_dsl.report.drawing.sheet import Sheet
from foresee_dsl.report.picture.reading import read_subject
from foresee_dsl.report.picture.sheet import FILE_SIZES, LIVE_SIZES, WIDTH, sheet_of
from foresee_dsl.report.picture.subject import Mistake, SceneSubject


@dataclass(frozen=True)
class Drawing:
    """A picture together with the scene that it shows."""

    subject: SceneSubject
    sheet: Sheet

    @property
    def mistakes(self) -> tuple[Mistake, ...]:
        """Return the errors in the text of the scene."""
        return self.subject.mistakes


def draw(
    address: str,
    overlay: Mapping[Path, str] | None = None,
    *,
    width: float = WIDTH,
    whole: bool = False,
    live: bool = False,
    allow_outside: bool = True,
) -> Drawing:
    """Draw a scenario, case, clip, mutant or network.

    Args:
        address: `FILE[::CASE]`. overlay: texts that replace those on the disk, by absolute path.
        width: px. whole: show the whole network. live: size the letters for exactly this width, not for any width at
            which the picture may be shown.
        allow_outside: see `loading.load_test_case`.

    Raises:
        InputError: an error in a text. CompileError: the network cannot be built.
    """
    subject = read_subject(address, overlay, allow_outside=allow_outside)
    return Drawing(subject, sheet_of(subject, width=width, whole=whole, sizes=LIVE_SIZES if live else FILE_SIZES))

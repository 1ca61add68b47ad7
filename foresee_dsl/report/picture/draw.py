"""Draws the file or case of an address, for the command line, the live page and the language server: as a picture, and
as the answer of the live page, which is the current picture or the errors in the text with their places."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from foresee_dsl.errors import Diagnostic, ForeseeError, InputError
from foresee_dsl.files import absolute, data_folder, rendered, templates
from foresee_dsl.report.drawing.palette import PAINTS
from foresee_dsl.report.drawing.sheet import Sheet
from foresee_dsl.report.drawing.svg import style_of, svg_of
from foresee_dsl.report.picture.reading import read_subject
from foresee_dsl.report.picture.sheet import FILE_SIZES, LIVE_SIZES, WIDTH, sheet_of
from foresee_dsl.report.picture.subject import Mistake, SceneSubject


@dataclass(frozen=True)
class Drawing:
    """A picture together with the scene that it shows."""

    subject: SceneSubject
    sheet: Sheet


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


NARROWEST, WIDEST = 280.0, 2400.0
"""Smallest and largest width of a picture, px. Ours: those of a small phone and of a large screen."""


def answer(
    file: Path,
    overlay: Mapping[Path, str] | None = None,
    *,
    case: str = "",
    width: float = 720.0,
    whole: bool = False,
    allow_outside: bool = True,
) -> dict[str, Any]:
    """Return a picture as plain data.

    Keys: `svg` and `style` (`svg` is None if there is no picture; the page then greys the last one), `title`, `cases`,
    `case`, `mistakes` (message, path, line and column, counted from 1; line 0 without a place), `files` (all files that
    were read).

    If the file no longer contains the case, its first case is drawn.
    """
    width = min(max(width, NARROWEST), WIDEST)
    for address in dict.fromkeys((f"{file}::{case}" if case else str(file), str(file))):
        try:
            drawing = draw(address, overlay, width=width, whole=whole, live=True, allow_outside=allow_outside)
        except InputError as error:
            if case and all(d.code in ("FS100", "FS131") for d in error.diagnostics):
                case = ""
                continue
            return {"svg": None, "mistakes": [_diagnostic(d) for d in error.diagnostics if d.severity == "error"]}
        except ForeseeError as error:
            return {"svg": None, "mistakes": [_plain(str(error))]}
        return _drawn(drawing)
    return {"svg": None, "mistakes": [_plain(f"there is no picture of {file.name}")]}


def _drawn(drawing: Drawing) -> dict[str, Any]:
    return {
        "svg": svg_of(drawing.sheet, styled=False),
        "style": style_of(drawing.sheet),
        "title": drawing.subject.title,
        "cases": list(drawing.subject.cases),
        "case": drawing.subject.case,
        "mistakes": [_mistake(mistake) for mistake in drawing.subject.mistakes],
        "files": [path.as_posix() for path in drawing.subject.files],
    }


def _mistake(mistake: Mistake) -> dict[str, Any]:
    place = mistake.text
    if place is None:
        return _plain(mistake.message)
    return _plain(mistake.message, place.path.as_posix(), place.line, place.column)


def _diagnostic(diagnostic: Diagnostic) -> dict[str, Any]:
    message = f"{diagnostic.message}: {diagnostic.help}" if diagnostic.help else diagnostic.message
    path = absolute(Path(diagnostic.path)).as_posix() if diagnostic.path else ""
    place = (diagnostic.span.line, diagnostic.span.column) if diagnostic.span is not None else ()
    return _plain(message, path, *place)


def _plain(message: str, path: str = "", line: int = 0, column: int = 0) -> dict[str, Any]:
    return {"message": message, "path": path, "line": line, "column": column}


def page_of(nonce: str, *, title: str, connect: str) -> str:
    """Return the page, which loads no other files and requests pictures at `connect` (if "", the page's host sends
    them).

    Its content security policy allows only the scripts and styles with the nonce.
    """
    folder = data_folder("templates") / "draw"
    return rendered(
        "draw/page.html",
        nonce=nonce,
        title=title,
        connect=connect,
        script=(folder / "page.js").read_text(encoding="utf-8"),
        style=templates("draw", markup=False).get_template("page.css.j2").render(paints=PAINTS),
    )

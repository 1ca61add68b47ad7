"""Writes tables of commands into `docs/background/performance.md`, between two marks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

PAGE = Path(__file__).parent.parent / "docs" / "background" / "measurements.md"
_BEGIN, _END = "<!-- {}: written by `{}` -->", "<!-- end of {} -->"


def table(headings: Sequence[str], rows: Iterable[Sequence[object]], *, words: int = 0) -> str:
    """Return a Markdown table; its columns are right-aligned except the first, and the last `words` columns."""
    numbers = len(headings) - 1 - words
    lines = [headings, ["---", *["---:"] * numbers, *["---"] * words], *rows]
    return "".join(f"| {' | '.join(map(str, line))} |\n" for line in lines)


def write_section(name: str, command: str, text: str, page: Path = PAGE) -> None:
    """Replace a section of the page.

    Raises:
        ValueError: the page has no such section.
    """
    begin, end = _BEGIN.format(name, command), _END.format(name)
    before, begin_mark, rest = page.read_text(encoding="utf-8").partition(begin)
    _, ended, after = rest.partition(end)
    if not (begin_mark and ended):
        raise ValueError(f"{page.name} has no section {begin} ... {end}")
    page.write_text(f"{before}{begin}\n\n{text.strip()}\n\n{end}{after}", encoding="utf-8")

"""Triggers that never fired, in lines for a terminal."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator

from rich.text import Text

from foresee_dsl.report.safe_text import safe
from foresee_dsl.report.verdicts import WHOLE
from foresee_dsl.simulate.results.unfired import Unfired

_MARK = "  never   "


def unfired_lines(found: Iterable[Unfired], width: int) -> Iterator[Text]:
    """Yield which triggers and steps never came, and how near they came, broken at a width (0: not at all)."""
    for one in found:
        alone = len(one.nearest) == 1 and one.nearest[0].text == one.text
        label = f"{one.name}: " if one.name else ""
        head = f"{'then when' if one.where else 'when'} {label}`{one.text}`"
        yield from _broken(f"{head}; {one.nearest[0].words}" if alone else head, _MARK, width)
        if one.together:
            yield Text("            each part held at some time, but never all; when most did:", style="dim")
        for part in () if alone else one.nearest:
            yield from _broken(f"`{part.text}`: {part.words}", " " * 12, width)


def _broken(text: str, begins: str, width: int) -> Iterator[Text]:
    """Yield a sentence behind its beginning; what is broken off stands two columns further in."""
    whole = safe(text, WHOLE)
    room = max(width - len(begins) - 2, 20)
    first, *rest = textwrap.wrap(whole, room, break_on_hyphens=False) if width and whole else [whole]
    yield Text.assemble((begins, "yellow"), (first, "dim" if not begins.strip() else ""))
    yield from (Text(f"{' ' * (len(begins) + 2)}{more}", style="dim") for more in rest)

"""Triggers that never fired, as lines for a terminal."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator

from rich.text import Text

from foresee_dsl.report.safe_text import safe
from foresee_dsl.report.verdicts import WHOLE
from foresee_dsl.simulate.results.unfired import UnfiredTrigger

_MARK = "  never   "


def unfired_lines(triggers: Iterable[UnfiredTrigger], width: int) -> Iterator[Text]:
    """Yield the triggers and steps that never fired and how near they came, in lines of at most `width` columns (0: one
    line each)."""
    for trigger in triggers:
        alone = len(trigger.nearest) == 1 and trigger.nearest[0].text == trigger.text
        label = f"{trigger.name}: " if trigger.name else ""
        head = f"{'then when' if trigger.where else 'when'} {label}`{trigger.text}`"
        yield from _broken(f"{head}; {trigger.nearest[0].words}" if alone else head, _MARK, width)
        if trigger.together:
            yield Text("            each part held at some time, but never all; when most did:", style="dim")
        for part in () if alone else trigger.nearest:
            yield from _broken(f"`{part.text}`: {part.words}", " " * 12, width)


def _broken(text: str, begins: str, width: int) -> Iterator[Text]:
    """Yield a sentence after `begins`, in lines; the second and later lines are indented by two columns more."""
    whole = safe(text, WHOLE)
    room = max(width - len(begins) - 2, 20)
    first, *rest = textwrap.wrap(whole, room, break_on_hyphens=False) if width and whole else [whole]
    yield Text.assemble((begins, "yellow"), (first, "dim" if not begins.strip() else ""))
    yield from (Text(f"{' ' * (len(begins) + 2)}{more}", style="dim") for more in rest)

"""By how much conditions hold: the robustness of signal temporal logic, kept within one dimension.

The margin of a comparison is how far its measure is from the bound, positive where it holds. `and`, `always` and `for`
take the smallest, `or` and `eventually` the largest, `not` turns the sign (Donze and Maler, "Robust Satisfaction of
Temporal Logic over Real-Valued Signals", FORMATS 2010). Metres and seconds have no smaller and larger: across
dimensions, what decides whether it holds decides the margin, the first where several do.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

from foresee_dsl.language.model import Condition


@dataclass(frozen=True, slots=True)
class Outcome:
    """Whether a condition holds at a frame, and by how much.

    Attributes:
        held: it does.
        margin: in the SI unit of `unit`, positive where the condition holds; NaN where there is no number.
        unit: the unit word of what decides, as its author wrote it; "" where there is no number.
        decides: the part that decides.
        dimension: of the margin; margins of one dimension can be compared.
    """

    held: bool
    margin: float = math.nan
    unit: str = ""
    decides: Condition | None = None
    dimension: str = ""

    def negated(self) -> Outcome:
        """Return the outcome of the opposite."""
        return replace(self, held=not self.held, margin=-self.margin)


def every(outcomes: Iterable[Outcome | None], *, unknown: bool = False) -> Outcome | None:
    """Return the outcome of `and`.

    One that does not hold decides; otherwise it cannot be said where one (or more that is not there: `unknown`) cannot.
    """
    return _joined(tuple(outcomes), enough=False, unknown=unknown)


def some(outcomes: Iterable[Outcome | None]) -> Outcome | None:
    """Return the outcome of `or`. One that holds decides; otherwise it cannot be said where one cannot."""
    return _joined(tuple(outcomes), enough=True, unknown=False)


def _joined(outcomes: tuple[Outcome | None, ...], *, enough: bool, unknown: bool) -> Outcome | None:
    """Join outcomes of which one with `held == enough` is enough to decide.

    The margin is that of a part that decides: of those in the dimension of the first, the nearest to the opposite for
    `and`, the furthest from it for `or`.
    """
    known = [outcome for outcome in outcomes if outcome is not None]
    deciding = [outcome for outcome in known if outcome.held == enough]
    if not deciding:
        if unknown or len(known) < len(outcomes):
            return None
        deciding = known
    numbers = [outcome for outcome in deciding if not math.isnan(outcome.margin)]
    if not numbers:
        return deciding[0]
    alike = [outcome for outcome in numbers if outcome.dimension == numbers[0].dimension]
    return (max if enough else min)(alike, key=lambda outcome: outcome.margin)

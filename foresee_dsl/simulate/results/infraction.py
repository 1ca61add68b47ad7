"""The traffic rules by which a run is judged, and the record of a broken rule.

Sources: the Vienna Convention on Road Traffic of 1968 (VCRT) and the Vienna Convention on Road Signs and Signals of
1968 (VCRSS) define the rules; the thresholds of the stop sign are those of CARLA's leaderboard, whose infractions the
rules cover.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Self

from pydantic import TypeAdapter, ValidationError

from foresee_dsl.documents import rounded


class Rule(StrEnum):
    """A traffic rule.

    Attributes:
        breaks: how an actor breaks it, in words that follow the actor's name, with braces for the other actor, the
            place and the value.
        source: where it is defined.
        fails: whether a run fails if the ego breaks the rule. A driver's mission does not say where stop signs are, so
            an ego that passes a stop sign is only reported.
    """

    _value_: str
    breaks: str
    source: str
    fails: bool

    def __new__(cls, value: str, breaks: str, source: str, effect: str = "fails") -> Self:
        """Create a member; `effect`: `fails` or `reports`."""
        rule = str.__new__(cls, value)
        rule._value_, rule.breaks, rule.source, rule.fails = value, breaks, source, effect == "fails"
        return rule

    RED = "red_light", "runs red at {place}", "VCRSS article 23(1)(a)(ii)"
    STOP = (
        "stop_sign",
        "does not stop at the stop line of {place} (slowest {value:.1f} m/s)",
        "VCRSS article 10(3)",
        "reports",
    )
    CROSSING = "crossing", "does not yield to {other} at the crossing of {place}", "VCRT article 21(2)"
    PRIORITY = "priority", "does not yield to {other} at {place}", "VCRT articles 1(aa) and 18"
    SPEED = "speed_limit", "drives up to {kmh:.0f} km/h faster than the limit on {place}", "VCRT article 13(2)"
    SIDE = "wrong_side", "drives on the wrong side of {place}", "VCRT articles 10(3) and 12(1)"
    BLOCKED = "blocked_junction", "stands in the way of others in {place}", "VCRT article 18(5)"


@dataclass(frozen=True)
class Infraction:
    """A broken rule.

    Attributes:
        rule: the rule. actor: id of the actor that broke it. time_s: time at which the actor broke the rule, or began
            to.
        place: id of the junction, or of the road's edge. until_s: time at which it stopped breaking the rule; equal to
            `time_s` if the infraction has no duration.
        other: id of the actor to which it did not yield, or "".
        value: slowest speed at the stop line, or the largest speed above the limit, m/s; otherwise None.
    """

    rule: Rule
    actor: str
    time_s: float
    place: str
    until_s: float
    other: str = ""
    value: float | None = None

    def as_document(self) -> dict[str, object]:
        """Return the infraction as a JSON document."""
        return {
            "rule": self.rule,
            "actor": self.actor,
            "time_s": rounded(self.time_s, 2),
            "until_s": rounded(self.until_s, 2),
            "place": self.place,
            "with": self.other,
            "value": rounded(self.value, 2),
            "sentence": self.sentence,
            "source": self.source,
        }

    @property
    def source(self) -> str:
        """Where the rule is defined."""
        return self.rule.source

    @property
    def clause(self) -> str:
        """Return the infraction in words, without the time: `runs red at king_oak`."""
        value = self.value or 0.0
        return self.rule.breaks.format(other=self.other, place=self.place, value=value, kmh=value * 3.6)

    @property
    def sentence(self) -> str:
        """Return the infraction in words: `ego runs red at king_oak, 12.30 s`."""
        until = f" to {self.until_s:.2f} s" if self.until_s > self.time_s else ""
        return f"{self.actor} {self.clause}, {self.time_s:.2f} s{until}"


_STORED: TypeAdapter[tuple[Infraction, ...]] = TypeAdapter(tuple[Infraction, ...])


def infractions_in(meta: Mapping[str, Any]) -> tuple[Infraction, ...]:
    """Return the infractions that a trace's `meta` contains; an empty tuple if they cannot be read, for example because
    an older version wrote them.
    """
    try:
        return _STORED.validate_python(meta.get("infractions", ()))
    except ValidationError:
        return ()

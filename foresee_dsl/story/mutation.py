"""What a mutation changed, in words."""

from __future__ import annotations

from foresee_dsl.language.model import Change, Quantity
from foresee_dsl.story.wording import short


def changed(change: Change) -> str:
    """Return a change as what it does: `walker is 1.38 times as fast`."""
    who = short(change.actor)
    if not isinstance(change.now, Quantity) or not isinstance(change.was, Quantity):
        return f"{who} is {_written(change.now)} instead of {_written(change.was)}"
    now, was = change.now.si, change.was.si
    more, amount, side = now > was, abs(now - was), "left" if now > was else "right"
    words = {
        "timing": f"is {now / was if was else 0:.2f} times as fast",
        "steer": f"is steered to the {side}{_from(change)}",
        "line": f"keeps {amount:.2f} m farther {side}",
        "delay": f"starts {amount:.2f} s {'later' if more else 'earlier'}",
        "moving": f"begins {amount:.1f} m {'farther on' if more else 'farther back'}",
        "speed": f"drives {now * 3.6:.0f} instead of {was * 3.6:.0f} km/h",
    }
    if change.property in words:
        return f"{who} {words[change.property]}"
    return f"{who}.{change.property} is {_written(change.now)} instead of {_written(change.was)}"


def _from(change: Change) -> str:
    return f" from {change.start.si:.2f} s" if isinstance(change.start, Quantity) else ""


def _written(value: Quantity | str) -> str:
    """A model's name (`car.suv`) or anything else as it is written."""
    return short(str(value)) if isinstance(value, str) else f"{value.si:g}"

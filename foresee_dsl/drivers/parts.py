"""The parts of a driver, and the truth that a driver gets in the place of a part.

Every driver can be driven with ideal perception (ideal sensors) and with ideal control (the vehicle follows the
driver's answer without delay). A driver that declares more parts (`WithParts`) is told before each run which of them
are ideal, and takes the truth in their place. The suffix of its name says so: `pdm+ideal_tracking`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Protocol, runtime_checkable

if TYPE_CHECKING:  # consent needs the suffixes alone: a check of a file must not load numpy
    from foresee_dsl.drivers.protocol import ActorClass, FloatArray, SignalColour


class DriverPart(StrEnum):
    """A part of a driver that can be replaced by an ideal one; the members are in the order in which a driver uses its
    parts.
    """

    PERCEPTION = "perception"
    """Sensors and object list. When it is ideal, the driver sees all actors within 80 m exactly, without delay, and
    nothing hides them."""
    TRACKING = "tracking"
    """Motion and identity of the perceived objects. When it is ideal, heading, speed, acceleration and yaw rate are the
    true ones; an object that was perceived once is never lost, and keeps the error of its last perceived position."""
    PREDICTION = "prediction"
    """The future motion of the others. When it is ideal, it is their motion in the run without the ideal part."""
    RULES = "rules"
    """The rules on the route: right of way, limits, signals, friction. When it is ideal, they are those of the
    simulator."""
    CONTROL = "control"
    """The way from the plan to the vehicle's motion. When it is ideal, the vehicle takes the planned acceleration and
    wheel angle at once."""


ALWAYS = (DriverPart.PERCEPTION, DriverPart.CONTROL)
"""The parts that each driver has, declared or not, because the simulator replaces them."""
IDEAL = "+ideal"
"""Suffix of the name of a driver with ideal perception; for another part, `_PART` follows it."""
_SUFFIXES = re.compile(rf"(?:\{IDEAL}(?:_(?:{'|'.join(part for part in DriverPart)}))?)+$")


@dataclass(frozen=True, slots=True)
class TrueActor:
    """The true state of another road user at the current step, for ideal parts.

    Attributes:
        tracks: its numbers in the object lists so far, the latest last; () if the sensors have not reported it.
        x, y: centre of the footprint, m; the units of the other fields are m, rad, m/s, m/s^2 and rad/s.
    """

    tracks: tuple[int, ...]
    kind: ActorClass
    x: float
    y: float
    heading_rad: float
    speed_mps: float
    acceleration_mps2: float
    yaw_rate_rad_s: float
    length_m: float
    width_m: float


class Truth(Protocol):
    """The true state of a run at the step at which the driver is asked; a driver uses it for its ideal parts."""

    def actors(self) -> Sequence[TrueActor]:
        """Return the true states of all other actors that are present."""
        ...

    def signals(self) -> dict[str, SignalColour]:
        """Return the colours of all signals of the mission, by `JunctionPassage.signal`."""
        ...

    def future(self, track: int, ahead_s: FloatArray) -> FloatArray | None:
        """Return where an object will be at these times from now, [T, 4] x, y, heading, speed; None if that is unknown.

        Args:
            track: its number in an object list. ahead_s: [T] times from now, s.
        """
        ...


@dataclass(frozen=True, slots=True)
class PlannedMotion:
    """The motion that a driver plans at this step: acceleration, m/s^2, and angle of the front wheels, rad (left
    positive).
    """

    acceleration_mps2: float
    steer_rad: float


@runtime_checkable
class WithParts(Protocol):
    """A driver that declares its parts, so that each can be replaced by an ideal one. Implementing it is optional.

    Attributes:
        parts: the parts (of perception, tracking, prediction, rules and control) that it can replace.
    """

    parts: Sequence[DriverPart]

    def idealise(self, ideal: frozenset[DriverPart], truth: Truth) -> None:
        """Take the truth in the place of these parts from the next `reset` on.

        It is called before the reset, and only if there are ideal parts.
        """
        ...


@runtime_checkable
class Planning(Protocol):
    """A driver that reports its planned motion besides its answer, for ideal control. Implementing it is optional."""

    def planned(self) -> PlannedMotion | None:
        """Return the motion that the last `step` planned; None if there is only its answer."""
        ...


def without_ideal(name: str) -> str:
    """Return a driver's name without the suffixes of its ideal parts."""
    return _SUFFIXES.sub("", name)


def ideal_parts(address: str) -> frozenset[DriverPart]:
    """Return the ideal parts of a driver's address: tracking for `pdm+ideal_tracking`."""
    match = _SUFFIXES.search(address.partition(":")[0])
    words = match.group().split(IDEAL)[1:] if match is not None else ()
    return frozenset(DriverPart(word[1:]) if word else DriverPart.PERCEPTION for word in words)


def with_ideal(address: str, parts: Iterable[DriverPart]) -> str:
    """Return the address of the same driver with exactly these ideal parts."""
    name, colon, argument = address.partition(":")
    wanted = frozenset(parts)
    suffixes = (IDEAL if part is DriverPart.PERCEPTION else f"{IDEAL}_{part}" for part in DriverPart if part in wanted)
    return f"{without_ideal(name)}{''.join(suffixes)}{colon}{argument}"


def parts_of(driver: object) -> tuple[DriverPart, ...]:
    """Return the parts of a driver that can be replaced by ideal ones, in the order of `DriverPart`."""
    declared = frozenset(map(DriverPart, driver.parts)) if isinstance(driver, WithParts) else frozenset()
    return tuple(part for part in DriverPart if part in declared or part in ALWAYS)

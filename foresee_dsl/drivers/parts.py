"""The parts of a driver, and what it gets in the place of a part that is replaced by an ideal one.

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
    """A part of a driver that an ideal one can replace, in the order in which a driver runs them."""

    PERCEPTION = "perception"
    """Sensors and object list. Ideal: all actors within 80 m, exact, without delay, nothing hidden."""
    TRACKING = "tracking"
    """Motion and identity of the perceived objects. Ideal: true heading, speed, acceleration and yaw rate; an object
    that was perceived once is never lost, and keeps the error of its last perceived position."""
    PREDICTION = "prediction"
    """What others will do. Ideal: what they then did in the run without the ideal part."""
    RULES = "rules"
    """What applies on the route: right of way, limits, signals, friction. Ideal: as the tool knows it."""
    CONTROL = "control"
    """From the plan to the vehicle. Ideal: the vehicle takes the planned acceleration and wheel angle at once."""


ALWAYS = (DriverPart.PERCEPTION, DriverPart.CONTROL)
"""Parts of every driver, declared or not, because the simulator replaces them."""
IDEAL = "+ideal"
"""Suffix of the name of a driver with ideal perception; with another part it is followed by `_PART`."""
_SUFFIXES = re.compile(rf"(?:\{IDEAL}(?:_(?:{'|'.join(part for part in DriverPart)}))?)+$")


@dataclass(frozen=True, slots=True)
class TrueActor:
    """The true state of another road user at the current step, for ideal parts.

    Attributes:
        tracks: its numbers in the object lists so far, the latest last; () if the sensors have not reported it.
        x, y: centre of the footprint, m; the rest in m, rad, m/s, m/s^2, rad/s.
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
    """What a run knows, at the step for which the driver is asked."""

    def actors(self) -> Sequence[TrueActor]:
        """Return the true states of all other actors that are present."""
        ...

    def signals(self) -> dict[str, SignalColour]:
        """Return the colours of all signals of the mission, by `JunctionPassage.signal`."""
        ...

    def future(self, track: int, ahead_s: FloatArray) -> FloatArray | None:
        """Return where an object will be, [T, 4] x, y, heading, speed at these times from now; None if it is unknown.

        Args:
            track: its number in an object list. ahead_s: [T] times from now, s.
        """
        ...


@dataclass(frozen=True, slots=True)
class PlannedMotion:
    """What a driver plans at this step, before its control: acceleration, and angle of the front wheels (left
    positive)."""

    acceleration_mps2: float
    steer_rad: float


@runtime_checkable
class WithParts(Protocol):
    """A driver that declares its parts, so that each can be replaced by an ideal one; optional.

    Attributes:
        parts: those of perception, tracking, prediction, rules and control that it can replace.
    """

    parts: Sequence[DriverPart]

    def idealise(self, ideal: frozenset[DriverPart], truth: Truth) -> None:
        """Take the truth in the place of these parts from the next `reset` on; called before it, only if there are
        any."""
        ...


@runtime_checkable
class Planning(Protocol):
    """A driver whose planned motion is known beside its answer, for ideal control; optional."""

    def planned(self) -> PlannedMotion | None:
        """Return what the last `step` planned; None: only its answer is known."""
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
    """Return the parts of a driver that can be replaced, in their order."""
    declared = frozenset(map(DriverPart, driver.parts)) if isinstance(driver, WithParts) else frozenset()
    return tuple(part for part in DriverPart if part in declared or part in ALWAYS)

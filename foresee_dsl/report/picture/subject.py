"""What a picture shows, in metres: bodies, ways, trigger places, signals, names, mistakes; and the texts of all."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from pathlib import Path

    from foresee_dsl.compile.roads.network import RoadNetwork

FloatArray = NDArray[np.float64]

Tone = Literal["ego", "a0", "a1", "a2", "a3", "a4", "a5", "thing", "traffic"]
"""Whose colour: the ego's, one of six that others get in turn, that of things that stand, of background traffic."""
TONES: tuple[Tone, ...] = ("a0", "a1", "a2", "a3", "a4", "a5")


Shown = Literal["green", "amber", "red", "off"]
"""What a signal shows."""
SHOWN: tuple[Shown, ...] = ("green", "amber", "red", "off")


@dataclass(frozen=True)
class TextPlace:
    """Where something is written: the file (absolute), its first line and column (1-based), and its last line."""

    path: Path
    line: int
    column: int
    end_line: int


@dataclass(frozen=True)
class Body:
    """Somebody at the start.

    Attributes:
        name: the actor's. about: model and speed, for a tooltip. kind: the model's class.
        corners: [4, 2] m: front left, rear left, rear right, front right. text: where it is written.
        changes: what a mutant changes about it, in a few words each. before: where it was without them, or None.
        mistake: what is wrong with it, "" for nothing.
    """

    name: str
    about: str
    kind: str
    tone: Tone
    corners: FloatArray
    text: TextPlace | None = None
    changes: tuple[str, ...] = ()
    before: FloatArray | None = None
    mistake: str = ""

    @property
    def middle(self) -> tuple[float, float]:
        """Its centre."""
        x, y = self.corners.mean(axis=0).tolist()
        return x, y


@dataclass(frozen=True)
class Way:
    """Where somebody goes: [N, 2] m, along a route or a path; `matters_m`: so much of it should be in the picture."""

    actor: str
    kind: Literal["route", "path"]
    tone: Tone
    points: FloatArray
    matters_m: float
    text: TextPlace | None = None
    goal: bool = False


@dataclass(frozen=True)
class Zone:
    """Where a trigger or an expectation looks: outlines (closed) or a line across a way, [N, 2] m, and what it says."""

    label: str
    outlines: tuple[FloatArray, ...]
    closed: bool
    at: tuple[float, float]
    text: TextPlace | None = None


@dataclass(frozen=True)
class Head:
    """What a signal shows at the start to a lane or a crossing: a line across it, [2, 2] m."""

    line: FloatArray
    colour: Shown


@dataclass(frozen=True)
class Name:
    """The name of a junction (at a point) or a road (along its middle line, [N, 2] m)."""

    kind: Literal["junction", "road"]
    text: str
    line: FloatArray
    matters: bool
    place: TextPlace | None = None
    note: str = ""
    """Behind the name: a signal's stage."""


@dataclass(frozen=True)
class Mistake:
    """What is wrong, where in the text, and where in the picture (None: nowhere)."""

    message: str
    text: TextPlace | None
    at: tuple[float, float] | None


@dataclass(frozen=True)
class Patch:
    """A slippery patch: its outline, [N, 2] m, its name, and what tyres hold there."""

    name: str
    outline: FloatArray
    friction: float
    text: TextPlace | None = None


@dataclass(frozen=True)
class Subject:
    """All of it.

    Attributes:
        title: the test case's address, or the network's name. about: its `doc`. changes: a mutant's, a line each.
        cases: the cases of the file, in order; `case`: the one that is shown.
        files: every file that was read for it.
    """

    title: str
    about: str
    network: RoadNetwork
    bodies: tuple[Body, ...] = ()
    ways: tuple[Way, ...] = ()
    zones: tuple[Zone, ...] = ()
    patches: tuple[Patch, ...] = ()
    heads: tuple[Head, ...] = ()
    names: tuple[Name, ...] = ()
    mistakes: tuple[Mistake, ...] = ()
    changes: tuple[str, ...] = ()
    cases: tuple[str, ...] = ()
    case: str = ""
    files: tuple[Path, ...] = ()

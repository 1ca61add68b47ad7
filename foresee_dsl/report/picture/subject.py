"""The contents of a picture in metres: bodies, ways, trigger places, signals, names and errors, with their places in
the files.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from foresee_dsl.kernels.arrays import FloatArray

if TYPE_CHECKING:
    from pathlib import Path

    from foresee_dsl.compile.roads.network import RoadNetwork
    from foresee_dsl.drivers.protocol import SignalColour
    from foresee_dsl.report.drawing.sheet import TextPlace


Tone = Literal["ego", "a0", "a1", "a2", "a3", "a4", "a5", "thing", "traffic"]
"""The colours of bodies: one for the ego, six that other actors get in turn, one for standing things, and one for
background traffic."""
TONES: tuple[Tone, ...] = ("a0", "a1", "a2", "a3", "a4", "a5")


@dataclass(frozen=True)
class Body:
    """The footprint of an actor at the start.

    Attributes:
        name: the actor's name. about: its model and speed, for a tooltip. kind: the model's class.
        corners: [4, 2] m: front left, rear left, rear right, front right. text: its place in the text.
        changes: the changes of a mutant to it, in a few words each.
        before: its corners without these changes; None if they are the same.
        mistake: the error in its statements; "" if there is none.
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
        """Return the centre of the body, m."""
        x, y = self.corners.mean(axis=0).tolist()
        return x, y


@dataclass(frozen=True)
class ShownWay:
    """The route or path of an actor, [N, 2] m; the picture should show its first `matters_m` metres."""

    actor: str
    kind: Literal["route", "path"]
    tone: Tone
    points: FloatArray
    matters_m: float
    text: TextPlace | None = None
    goal: bool = False


@dataclass(frozen=True)
class Zone:
    """The place of a condition: outlines (closed) or a line across a way, [N, 2] m; `label`: the condition."""

    label: str
    outlines: tuple[FloatArray, ...]
    closed: bool
    at: tuple[float, float]
    text: TextPlace | None = None


@dataclass(frozen=True)
class SignalLine:
    """The signal head of a lane or crossing: its colour at the start, and a line across the lane, [2, 2] m."""

    line: FloatArray
    colour: SignalColour


@dataclass(frozen=True)
class Name:
    """The name of a junction (`line` is a point) or a road (`line` is its middle line), [N, 2] m."""

    kind: Literal["junction", "road"]
    text: str
    line: FloatArray
    matters: bool
    place: TextPlace | None = None
    note: str = ""
    """Text after the name: the stage of the junction's signal."""


@dataclass(frozen=True)
class Mistake:
    """An error, with its place in the text, and its point in the picture, m; None if it has no such point."""

    message: str
    text: TextPlace | None
    at: tuple[float, float] | None


@dataclass(frozen=True)
class Patch:
    """A slippery patch: its name, its outline, [N, 2] m, and its friction coefficient."""

    name: str
    outline: FloatArray
    friction: float
    text: TextPlace | None = None


@dataclass(frozen=True)
class SceneSubject:
    """The scene that a picture shows.

    Attributes:
        title: the test case's address, or the network's name. about: its `doc` text. changes: a mutant's change lines.
        cases: the cases of the file, in order. case: the case that is drawn. files: all files that were read.
    """

    title: str
    about: str
    network: RoadNetwork
    bodies: tuple[Body, ...] = ()
    ways: tuple[ShownWay, ...] = ()
    zones: tuple[Zone, ...] = ()
    patches: tuple[Patch, ...] = ()
    heads: tuple[SignalLine, ...] = ()
    names: tuple[Name, ...] = ()
    mistakes: tuple[Mistake, ...] = ()
    changes: tuple[str, ...] = ()
    cases: tuple[str, ...] = ()
    case: str = ""
    files: tuple[Path, ...] = ()

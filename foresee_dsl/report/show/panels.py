"""Panels: the map and the road users of one moment in a window around ego and opponent, up being the ego's way."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Literal

import numpy as np
import shapely

from foresee_dsl.compile.bundle import SumoBundle
from foresee_dsl.kernels.boxes import corners
from foresee_dsl.report.ground import Bounds, FloatArray, Ground, Layer, ground_of, with_patches, within
from foresee_dsl.report.show.measures import Measures
from foresee_dsl.report.show.moments import Snapshot
from foresee_dsl.simulate.trace import HEADING, SPEED, Trace, X, Y

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

Up = Literal["ego", "north"]

SIDES_M = (16.0, 24.0, 32.0, 48.0, 64.0, 96.0)
"""Sides of windows. Ours: the smallest shows a crossing of two lanes, the largest what sensors reach in a town."""
MARGIN_M = 5.0
"""Free space around ego and opponent within the window. Ours: a lane and a half."""
TOGETHER_M = 80.0
"""An opponent that is farther away is not in the window. Ours: the range at which sensors see a car."""
AHEAD_SHARE = 0.2
"""Without an opponent the ego is this share of the window behind its middle: what is ahead matters."""
PARKED_MPS = 0.1
"""An actor that is never faster is parked (or an obstacle)."""


class Role(StrEnum):
    """Who a footprint is of, in the order of drawing; a ghost is where somebody was in the parent's run."""

    PARKED = "parked"
    OTHER = "other"
    GHOST = "ghost"
    OPPONENT = "opponent"
    EGO = "ego"


@dataclass(frozen=True)
class Footprint:
    """Somebody in a panel.

    Attributes:
        actor: the id. kind: the model's class. corners: [4, 2] m in the panel: front left, rear left, rear right and
            front right. heading_rad: counter-clockwise from the panel's right. speed_mps: now.
    """

    role: Role
    actor: str
    kind: str
    corners: FloatArray
    heading_rad: float
    speed_mps: float

    @property
    def middle(self) -> FloatArray:
        """The centre, [2] m in the panel."""
        middle: FloatArray = self.corners.mean(axis=0)
        return middle


@dataclass(frozen=True)
class Window:
    """Where a panel is in the world: its middle and side, m, and by how much the world is turned, rad."""

    x: float
    y: float
    side_m: float
    turn_rad: float

    @property
    def bounds(self) -> Bounds:
        """Around the window in any direction."""
        reach = self.side_m * math.sqrt(0.5) + 1.0
        return self.x - reach, self.y - reach, self.x + reach, self.y + reach

    def points(self, world: FloatArray) -> FloatArray:
        """Return [N, 2] points of the world in the panel."""
        cos, sin = math.cos(self.turn_rad), math.sin(self.turn_rad)
        dx, dy = world[:, 0] - self.x, world[:, 1] - self.y
        return np.column_stack([cos * dx - sin * dy, sin * dx + cos * dy])

    def shape(self, world: BaseGeometry) -> BaseGeometry:
        """Return a shape of the world in the panel, cut to the window."""
        turned = shapely.transform(world, self.points)
        half = self.side_m / 2
        return shapely.clip_by_rect(turned, -half, -half, half, half)


@dataclass(frozen=True)
class Panel:
    """One moment: x to the right and y up, m, from the middle of a square window.

    Attributes:
        snapshot: the moment. window: where it is in the world.
        ground: by layer, cut to the window. footprints: in the order in which they are drawn.
        ego_mps, gap_m: the ego's speed, and the gap to the opponent (NaN: none).
    """

    snapshot: Snapshot
    window: Window
    ground: Mapping[Layer, BaseGeometry]
    footprints: tuple[Footprint, ...]
    ego_mps: float
    gap_m: float

    @property
    def side_m(self) -> float:
        """Side of the window."""
        return self.window.side_m

    @property
    def north_rad(self) -> float:
        """Where north is, counter-clockwise from the right."""
        return math.pi / 2 + self.window.turn_rad


@dataclass(frozen=True)
class Strip:
    """The panels of one run; `opponent`: its id, "" for none."""

    title: str
    opponent: str
    opponent_kind: str
    panels: tuple[Panel, ...]

    @property
    def moments(self) -> tuple[Snapshot, ...]:
        """The moments of the panels."""
        return tuple(panel.snapshot for panel in self.panels)

    @property
    def roles(self) -> tuple[Role, ...]:
        """The roles that occur."""
        found = {footprint.role for panel in self.panels for footprint in panel.footprints}
        return tuple(role for role in Role if role in found)


def strip_panels(
    trace: Trace,
    bundle: SumoBundle,
    found: Measures,
    opponent: str,
    moments: Sequence[Snapshot],
    *,
    windows: Sequence[Window],
    ghost: Trace | None = None,
) -> tuple[Panel, ...]:
    """Return a panel for each moment of a run.

    Args:
        trace: the run. bundle: its compiled test case. found: what was measured of it. opponent: its id, "" for none.
        moments: which; those after the run's end are left out. windows: around each of them.
        ghost: the parent's run, whose ego and opponent are drawn too.
    """
    if not moments:
        return ()
    around = np.array([window.bounds for window in windows])
    bounds = (*around[:, :2].min(axis=0).tolist(), *around[:, 2:].max(axis=0).tolist())
    ground = with_patches(ground_of(bundle.network, within(bounds)), bundle.scene.slippery)
    return tuple(
        Panel(
            snapshot=one,
            window=window,
            ground=_cut(ground, window),
            footprints=tuple(_footprints(trace, opponent, one.frame, window, ghost)),
            ego_mps=float(found.ego_mps[one.frame]),
            gap_m=float(found.gap_m[one.frame]),
        )
        for one, window in zip(moments, windows, strict=True)
        if one.frame < trace.frames
    )


def windows_around(
    trace: Trace, bundle: SumoBundle, opponent: str, moments: Sequence[Snapshot], up: Up
) -> tuple[Window, ...]:
    """Return a window around ego and opponent for each moment; what is up is the same in all of them.

    Args:
        trace: the run. bundle: its compiled test case. opponent: its id, "" for none. moments: which.
        up: the ego's way at the last of them, or north.
    """
    turn = math.pi / 2 - _way(trace, bundle, moments[-1].frame) if up == "ego" and moments else 0.0
    return tuple(_window(trace, opponent, one.frame, turn) for one in moments)


def _way(trace: Trace, bundle: SumoBundle, frame: int) -> float:
    """Return the heading of the lane that the ego is on, so that roads are upright; in a junction, the ego's own."""
    x, y, heading = trace.states[frame, 0, [X, Y, HEADING]].tolist()
    near = bundle.network.nearest_lane(x, y, heading)
    if near is None or near.lane.internal:
        return float(heading)
    return near.lane.line.at(near.pos_m)[2]


def _cut(ground: Ground, window: Window) -> Ground:
    shapes = {layer: window.shape(shape) for layer, shape in ground.items()}
    return {layer: shape for layer, shape in shapes.items() if not shape.is_empty}


def _window(trace: Trace, opponent: str, frame: int, turn: float) -> Window:
    """Return the smallest window around ego and opponent; around what is ahead of the ego where there is none near."""
    x, y, heading = trace.states[frame, 0, [X, Y, HEADING]].tolist()
    if opponent:
        other = trace.states[frame, trace.index(opponent), [X, Y]]
        if np.hypot(*(other - (x, y))) <= TOGETHER_M:  # False where it is absent
            pair = np.array([(x, y), other.tolist()])
            turned = Window(0.0, 0.0, 0.0, turn).points(pair)
            reach = float(np.abs(turned[1] - turned[0]).max()) + 2 * MARGIN_M
            side = next((side for side in SIDES_M if side >= reach), SIDES_M[-1])
            middle = pair.mean(axis=0).tolist()
            return Window(middle[0], middle[1], side, turn)
    side = SIDES_M[3]
    ahead = AHEAD_SHARE * side
    return Window(x + ahead * math.cos(heading), y + ahead * math.sin(heading), side, turn)


def _footprints(trace: Trace, opponent: str, frame: int, window: Window, ghost: Trace | None) -> list[Footprint]:
    found = [
        one
        for k, info in enumerate(trace.actors)
        if (one := _footprint(trace, k, frame, window, _role(trace, k, opponent, info.id))) is not None
    ]
    if ghost is not None and frame < ghost.frames:
        ids = [info.id for info in ghost.actors]
        found += [
            one
            for name in ("ego", opponent)
            if name in ids and (one := _footprint(ghost, ids.index(name), frame, window, Role.GHOST)) is not None
        ]
    order = list(Role)
    return sorted(found, key=lambda one: order.index(one.role))


def _role(trace: Trace, actor: int, opponent: str, name: str) -> Role:
    if actor == 0:
        return Role.EGO
    if name == opponent:
        return Role.OPPONENT
    speeds = trace.states[:, actor, SPEED]
    return Role.OTHER if np.nanmax(speeds, initial=0.0) > PARKED_MPS else Role.PARKED


def _footprint(trace: Trace, actor: int, frame: int, window: Window, role: Role) -> Footprint | None:
    """Return an actor's footprint in a window, or None where it is absent or outside."""
    row = trace.states[frame, actor]
    if np.isnan(row[X]):
        return None
    info = trace.actors[actor]
    outline = window.points(corners(trace.boxes(actor)[frame]))
    if np.abs(outline).min(axis=0).max() > window.side_m / 2:
        return None
    turned = float(row[HEADING]) + window.turn_rad
    return Footprint(role, info.id, info.kind, outline, turned, float(row[SPEED]))

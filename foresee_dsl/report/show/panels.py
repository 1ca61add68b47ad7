"""Panels of a strip: the map and the actors of a moment in a window around ego and opponent."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import TYPE_CHECKING, Literal

import numpy as np
import shapely

from foresee_dsl.compile.bundle import SumoBundle
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.boxes import corners
from foresee_dsl.kernels.constants import STANDS_MPS
from foresee_dsl.report.drawing.ground import Bounds, Ground, Layer, ground_of, with_patches, within
from foresee_dsl.report.drawing.shapes import body_shapes, ghost_shape, ground_shapes
from foresee_dsl.report.drawing.sheet import DrawnPart
from foresee_dsl.report.safe_text import shortened
from foresee_dsl.report.show.measures import Measures
from foresee_dsl.report.show.moments import Snapshot
from foresee_dsl.simulate.results.outcome import contact_of
from foresee_dsl.simulate.trace import HEADING, SPEED, STEP_S, Trace, X, Y

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

Up = Literal["ego", "north"]

SIDES_M = (16.0, 24.0, 32.0, 48.0, 64.0, 96.0)
"""Sides of windows, m. Ours: the smallest shows a crossing of two lanes, the largest the range of sensors in a town."""
MARGIN_M = 5.0
"""Free space around ego and opponent within the window, m. Ours: one and a half lanes."""
TOGETHER_M = 80.0
"""An opponent farther away than this is not in the window, m. Ours: the range at which sensors see a car."""
AHEAD_SHARE = 0.2
"""Without an opponent, the ego is this share of the window's side behind the middle, so that more of the road ahead is
visible. Ours."""
VIEW_S = 3.0
"""A fixed view contains ego and opponent from this long before the most critical moment, s. Ours."""
_LONGEST_TITLE = 60
"""Maximum length of an actor's name in a tooltip, characters."""


class Role(StrEnum):
    """Roles of footprints, in the order of drawing; a ghost is an actor's footprint in the parent's run.

    The roles are also the names of the footprints' paints.
    """

    PARKED = "parked"
    OTHER = "other"
    GHOST = "ghost"
    OPPONENT = "opponent"
    EGO = "ego"


@dataclass(frozen=True)
class Footprint:
    """The footprint of an actor in a panel.

    Attributes:
        actor: the actor's id. kind: the model's class.
        corners: [4, 2] m in the panel: front left, rear left, rear right and front right.
    """

    role: Role
    actor: str
    kind: str
    corners: FloatArray


@dataclass(frozen=True)
class PanelWindow:
    """The part of the world in a panel: its middle and side, m, and the angle by which it is turned, rad."""

    x: float
    y: float
    side_m: float
    turn_rad: float

    @property
    def bounds(self) -> Bounds:
        """Return bounds that contain the window in any orientation, m."""
        reach = self.side_m * math.sqrt(0.5) + 1.0
        return self.x - reach, self.y - reach, self.x + reach, self.y + reach

    def points(self, world: FloatArray) -> FloatArray:
        """Return points of the world in the panel, [N, 2] m."""
        cos, sin = math.cos(self.turn_rad), math.sin(self.turn_rad)
        dx, dy = world[:, 0] - self.x, world[:, 1] - self.y
        return np.column_stack([cos * dx - sin * dy, sin * dx + cos * dy])

    def shape(self, world: BaseGeometry) -> BaseGeometry:
        """Return a shape of the world in the panel, clipped to the window."""
        turned = shapely.transform(world, self.points)
        half = self.side_m / 2
        return shapely.clip_by_rect(turned, -half, -half, half, half)


@dataclass(frozen=True)
class Panel:
    """A moment in a square window; x points to the right and y up, m, from the window's middle.

    Attributes:
        snapshot: the moment. window: the part of the world in the panel.
        ground: shapes by layer, clipped to the window. footprints: the actors in the order of drawing.
        ego_mps, gap_m: the ego's speed, and the gap to the opponent (NaN without one).
    """

    snapshot: Snapshot
    window: PanelWindow
    ground: Mapping[Layer, BaseGeometry]
    footprints: tuple[Footprint, ...]
    ego_mps: float
    gap_m: float

    @property
    def side_m(self) -> float:
        """Return the side of the window, m."""
        return self.window.side_m

    @property
    def north_rad(self) -> float:
        """Return the direction of north, rad, counter-clockwise from the panel's right."""
        return math.pi / 2 + self.window.turn_rad


@dataclass(frozen=True)
class Strip:
    """The panels of a run; `opponent`: id of the opponent, "" for none."""

    title: str
    opponent: str
    opponent_kind: str
    panels: tuple[Panel, ...]

    @property
    def moments(self) -> tuple[Snapshot, ...]:
        """Return the moments of the panels."""
        return tuple(panel.snapshot for panel in self.panels)

    @property
    def roles(self) -> tuple[Role, ...]:
        """Return the roles that occur in the panels."""
        present = {footprint.role for panel in self.panels for footprint in panel.footprints}
        return tuple(role for role in Role if role in present)


def strip_panels(
    trace: Trace,
    bundle: SumoBundle,
    measures: Measures,
    opponent: str,
    moments: Sequence[Snapshot],
    *,
    windows: Sequence[PanelWindow],
    ghost: Trace | None = None,
) -> tuple[Panel, ...]:
    """Return a panel for each moment of a run.

    Args:
        trace: the run. bundle: its compiled test case. measures: its values. opponent: id of the opponent, "" for none.
        moments: the moments, of which those after the run's end are left out. windows: the window of each moment.
        ghost: the parent's run, whose ego and opponent are drawn as ghosts.
    """
    if not moments:
        return ()
    around = np.array([window.bounds for window in windows])
    bounds = (*around[:, :2].min(axis=0).tolist(), *around[:, 2:].max(axis=0).tolist())
    ground = with_patches(ground_of(bundle.network, within(bounds)), bundle.scene.slippery)
    cuts = {window: cut(ground, window) for window in dict.fromkeys(windows)}
    return tuple(
        Panel(
            snapshot=moment,
            window=window,
            ground=cuts[window],
            footprints=tuple(_footprints(trace, opponent, moment.frame, window, ghost)),
            ego_mps=float(measures.ego_mps[moment.frame]),
            gap_m=float(measures.gap_m[moment.frame]),
        )
        for moment, window in zip(moments, windows, strict=True)
        if moment.frame < trace.frames
    )


def panel_parts(panel: Panel, px_per_m: float = math.inf, *, bars: bool = True) -> tuple[DrawnPart, ...]:
    """Return the parts of a panel from back to front, m; `px_per_m`, `bars`: see `body_shapes` and `ground_shapes`."""
    ground = (DrawnPart(shape.paint, (shape,)) for shape in ground_shapes(panel.ground, bars=bars))
    # Pedestrians are drawn last, because at a contact the ego would cover them.
    bodies = sorted(panel.footprints, key=lambda footprint: footprint.kind == "pedestrian")
    return (*ground, *(_body(footprint, px_per_m) for footprint in bodies))


def _body(footprint: Footprint, px_per_m: float) -> DrawnPart:
    role, title = footprint.role, shortened(footprint.actor, _LONGEST_TITLE)
    if role is Role.GHOST:
        return DrawnPart(role.value, (ghost_shape(footprint.corners),), title=title)
    return DrawnPart(role.value, body_shapes(footprint.corners, footprint.kind, role.value, px_per_m), title=title)


def windows_around(
    trace: Trace, bundle: SumoBundle, opponent: str, moments: Sequence[Snapshot], up: Up
) -> tuple[PanelWindow, ...]:
    """Return a window around ego and opponent for each moment; the direction that is up is the same in all of them.

    Args:
        trace: the run. bundle: its compiled test case. opponent: id of the opponent, "" for none. moments: the moments.
        up: the direction that points upwards: that of the ego's lane at the last moment, or north.
    """
    turn = math.pi / 2 - _way(trace, bundle, moments[-1].frame) if up == "ego" and moments else 0.0
    return tuple(_window(trace, opponent, moment.frame, turn) for moment in moments)


def key_frame(trace: Trace, gap_m: FloatArray) -> int:
    """Return the most critical frame of a run: the contact, else the smallest gap, else the last frame.

    Args:
        trace: the run. gap_m: [T] gap between ego and opponent, NaN where there is none.
    """
    if contact_of(trace) or np.isnan(gap_m).all():
        return trace.frames - 1
    return int(np.nanargmin(gap_m))


def window_before(trace: Trace, bundle: SumoBundle, opponent: str, frame: int) -> PanelWindow:
    """Return the smallest window around ego and opponent during the `VIEW_S` before a frame, with the ego's way up."""
    frames = np.arange(max(frame - round(VIEW_S / STEP_S), 0), frame + 1)
    last = _window(trace, opponent, frame, math.pi / 2 - _way(trace, bundle, frame))
    columns = [0, trace.index(opponent)] if opponent else [0]
    places = trace.states[frames][:, columns][:, :, [X, Y]].reshape(-1, 2)
    near = places[np.hypot(*(places - trace.states[frame, 0, [X, Y]]).T) <= TOGETHER_M]  # False where absent
    turned = replace(last, x=0.0, y=0.0).points(near)
    low, high = turned.min(axis=0), turned.max(axis=0)
    side = next((side for side in SIDES_M if side >= float((high - low).max()) + 2 * MARGIN_M), SIDES_M[-1])
    back = PanelWindow(0.0, 0.0, 0.0, -last.turn_rad)
    x, y = back.points(((low + high) / 2)[None])[0].tolist()
    return replace(last, x=x, y=y, side_m=side)


def _way(trace: Trace, bundle: SumoBundle, frame: int) -> float:
    """Return the heading of the ego's lane, rad; a panel shows it upwards, so that roads are vertical. In a junction,
    return the ego's own heading.
    """
    x, y, heading = trace.states[frame, 0, [X, Y, HEADING]].tolist()
    near = bundle.network.nearest_lane(x, y, heading)
    if near is None or near.lane.internal:
        return float(heading)
    return near.lane.line.at(near.pos_m)[2]


def cut(ground: Ground, window: PanelWindow) -> Ground:
    """Return the shapes of a ground that are in a window, in its coordinates."""
    shapes = {layer: window.shape(shape) for layer, shape in ground.items()}
    return {layer: shape for layer, shape in shapes.items() if not shape.is_empty}


def _window(trace: Trace, opponent: str, frame: int, turn: float) -> PanelWindow:
    """Return the smallest window around ego and opponent; without a near opponent, a window ahead of the ego."""
    x, y, heading = trace.states[frame, 0, [X, Y, HEADING]].tolist()
    if opponent:
        other = trace.states[frame, trace.index(opponent), [X, Y]]
        if np.hypot(*(other - (x, y))) <= TOGETHER_M:  # False where the actor is absent
            pair = np.array([(x, y), other.tolist()])
            turned = PanelWindow(0.0, 0.0, 0.0, turn).points(pair)
            reach = float(np.abs(turned[1] - turned[0]).max()) + 2 * MARGIN_M
            side = next((side for side in SIDES_M if side >= reach), SIDES_M[-1])
            middle = pair.mean(axis=0).tolist()
            return PanelWindow(middle[0], middle[1], side, turn)
    side = SIDES_M[3]
    ahead = AHEAD_SHARE * side
    return PanelWindow(x + ahead * math.cos(heading), y + ahead * math.sin(heading), side, turn)


def _footprints(trace: Trace, opponent: str, frame: int, window: PanelWindow, ghost: Trace | None) -> list[Footprint]:
    footprints = [
        footprint
        for k in range(len(trace.actors))
        if (footprint := _footprint(trace, k, frame, window, role_of(trace, k, opponent))) is not None
    ]
    if ghost is not None and frame < ghost.frames:
        ids = [info.id for info in ghost.actors]
        footprints += [
            footprint
            for name in ("ego", opponent)
            if name in ids and (footprint := _footprint(ghost, ids.index(name), frame, window, Role.GHOST)) is not None
        ]
    order = list(Role)
    return sorted(footprints, key=lambda footprint: order.index(footprint.role))


def role_of(trace: Trace, actor: int, opponent: str) -> Role:
    """Return the role of the actor in a column of a trace; `opponent`: id of the opponent, "" for none."""
    if actor == 0:
        return Role.EGO
    if trace.actors[actor].id == opponent:
        return Role.OPPONENT
    speeds = trace.states[:, actor, SPEED]
    return Role.OTHER if np.nanmax(speeds, initial=0.0) > STANDS_MPS else Role.PARKED


def _footprint(trace: Trace, actor: int, frame: int, window: PanelWindow, role: Role) -> Footprint | None:
    """Return an actor's footprint in a window; None if the actor is absent or outside the window."""
    if np.isnan(trace.states[frame, actor, X]):
        return None
    info = trace.actors[actor]
    outline = window.points(corners(trace.boxes(actor)[frame]))
    if np.abs(outline).min(axis=0).max() > window.side_m / 2:
        return None
    return Footprint(role, info.id, info.kind, outline)

"""Left-handed coordinates: CARLA's files have y to the right and angles clockwise; the import mirrors them."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from xml.etree.ElementTree import Element  # the type only; files are parsed by safe_xml

from foresee_dsl.compile.foreign.opendrive_geometry import Pose
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.exchange.outcome import Coordinates, ExchangeError
from foresee_exchange.naming import number
from foresee_exchange.openscenario.reading.source import Source
from foresee_exchange.openscenario.reading.ways.trajectories import nearest

_SAYS_SO = re.compile(r"\s*CARLA\s*:", re.IGNORECASE)
_ENOUGH = 2
"""Number of vehicles that decide without a hint: a single one may be on the wrong side on purpose (ours)."""
_TOWN = re.compile(r"(^|[/\\])Town\d\d", re.IGNORECASE)


def is_left_handed(
    source: Source, positions: Iterable[Element], network: RoadNetwork, wanted: Coordinates
) -> tuple[bool, str]:
    """Return whether a file's world positions are left-handed, and the reason (empty if they are not).

    `positions` are those of its vehicles. CARLA's scenario_runner takes coordinates as left-handed if the description
    begins with `CARLA:`. Otherwise they are left-handed if all vehicles stand on lanes only when mirrored (for a CARLA
    town: if more do than unmirrored).
    """
    if wanted is not Coordinates.auto:
        return wanted is Coordinates.left, "as asked for" if wanted is Coordinates.left else ""
    if _SAYS_SO.match(source.description):
        return True, "the file's description says CARLA"
    logic = source.root.find("RoadNetwork/LogicFile")
    town = logic is not None and _TOWN.search(logic.get("filepath", "")) is not None
    poses = [pose for position in positions if (pose := _world(position)) is not None]
    plain, mirrored = (sum(_fits(network, pose, side) for pose in poses) for side in (1.0, -1.0))
    decided = plain < mirrored if town else plain == 0 and len(poses) >= _ENOUGH
    if mirrored == len(poses) > 0 and decided:
        return True, "only then do its actors stand on lanes"
    return False, ""


def _world(position: Element) -> Pose | None:
    kind = position.find("WorldPosition")
    try:
        return None if kind is None else Pose(number(kind, "x"), number(kind, "y"), number(kind, "h", math.nan))
    except ExchangeError:
        return None


def _fits(network: RoadNetwork, pose: Pose, side: float) -> bool:
    """Return whether a pose is on a lane, and in its direction if it has one; `side` -1 mirrors it."""
    if math.isnan(pose.heading_rad):
        return network.nearest_lane(pose.x, pose.y * side, None, "car", 3.0) is not None
    return nearest(network, Pose(pose.x, pose.y * side, pose.heading_rad * side), "car") is not None

"""The map of a run as OSI messages: lanes, their boundaries, buildings, and the reference to real-world coordinates."""

from __future__ import annotations

from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from foresee_bridges.osi.library import Numbers, add_points, add_reference, osi3, set_size, set_vector, set_yaw
from foresee_dsl.compile.nets.safe_xml import parse_xml
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.compile.roads.polyline import Points
from foresee_dsl.compile.roads.topology import Lane
from foresee_dsl.exchange.network_parts import beside, lane_links, shifted

BUILDING_HEIGHT_M = 8.0
"""Height of buildings, m. Ours: two storeys; the language has outlines only."""
LINE_WIDTH_M = 0.12
"""Width of painted lines, m: narrow lines in German towns (RMS-1)."""
CURB_M = 0.12
"""Height of a curb, m. Ours: usual for sidewalks in towns."""


def add_map(ground_truth: Any, network: RoadNetwork, net_file: Path, numbers: Numbers) -> None:  # noqa: ANN401
    """Add lanes, lane boundaries, buildings and the map's projection to a ground truth."""
    _add_projection(ground_truth, net_file)
    links = lane_links(network)
    for lane in network.lanes.values():
        _add_lane(ground_truth, network, lane, links.get(lane.id, ((), ())), numbers)
    for k, outline in enumerate(network.buildings):
        _add_building(ground_truth.stationary_object.add(), outline, k, numbers)


def _add_projection(ground_truth: Any, net_file: Path) -> None:  # noqa: ANN401
    """Set PROJ's string and the offset of the map's own coordinates; a network in the language has neither."""
    location = parse_xml(net_file, "net", "a SUMO network").find("location")
    if location is None:
        return
    projection = location.get("projParameter", "!")
    x, y = (float(part) for part in location.get("netOffset", "0,0").split(","))
    if projection not in ("!", "-", ""):
        ground_truth.proj_string = projection
    if projection not in ("!", "-", "") or (x, y) != (0.0, 0.0):
        set_vector(ground_truth.proj_frame_offset.position, -x, -y)


def _add_lane(
    ground_truth: Any,  # noqa: ANN401
    network: RoadNetwork,
    lane: Lane,
    pairing: tuple[tuple[str, ...], tuple[str, ...]],
    numbers: Numbers,
) -> None:
    message = ground_truth.lane.add()
    message.id.value = numbers.of("lane", lane.id)
    add_reference(message.source_reference, "lane", lane.id)
    facts = message.classification
    facts.type, facts.subtype = _types(lane)
    add_points(facts.centerline, lane.shape)
    facts.centerline_is_driving_direction = True
    for before, after in product(pairing[0] or (None,), pairing[1] or (None,)):
        if before is None and after is None:
            continue
        pair = facts.lane_pairing.add()
        if before is not None:
            pair.antecessor_lane_id.value = numbers.of("lane", before)
        if after is not None:
            pair.successor_lane_id.value = numbers.of("lane", after)
    left, right = (beside(network, lane, side) for side in (1, -1))
    if left is not None:
        facts.left_adjacent_lane_id.add().value = numbers.of("lane", left.id)
    if right is not None:
        facts.right_adjacent_lane_id.add().value = numbers.of("lane", right.id)
    facts.left_lane_boundary_id.add().value = _add_boundary(ground_truth, lane, left, 1, numbers)
    # The line between two lanes of a kind is one boundary: that to the left of the right one.
    if right is not None and _share(lane, right):
        facts.right_lane_boundary_id.add().value = numbers.of("boundary", right.id, "1")
    else:
        facts.right_lane_boundary_id.add().value = _add_boundary(ground_truth, lane, right, -1, numbers)


def _share(lane: Lane, other: Lane) -> bool:
    """Return whether a painted line or nothing, not a curb, is between two lanes."""
    return ("pedestrian" in lane.kinds) == ("pedestrian" in other.kinds)


def _types(lane: Lane) -> tuple[int, int]:
    """Return OSI's type and subtype of a lane."""
    kinds = osi3().osi_lane_pb2.Lane.Classification
    if "car" in lane.kinds:
        return (kinds.TYPE_INTERSECTION if lane.internal else kinds.TYPE_DRIVING), kinds.SUBTYPE_NORMAL
    if lane.parking:
        subtype = kinds.SUBTYPE_PARKING
    elif "pedestrian" in lane.kinds:
        subtype = kinds.SUBTYPE_SIDEWALK
    elif "bicycle" in lane.kinds:
        subtype = kinds.SUBTYPE_BIKING
    else:
        subtype = kinds.SUBTYPE_RESTRICTED if lane.kinds or lane.strip else kinds.SUBTYPE_OTHER
    return kinds.TYPE_NONDRIVING, subtype


def _add_boundary(ground_truth: Any, lane: Lane, other: Lane | None, side: int, numbers: Numbers) -> int:  # noqa: ANN401
    """Add the boundary of a lane to its left (1) or right (-1), beside `other`; return its number.

    SUMO has no markings: lines are dashed between the lanes of a direction and solid at its sides, sidewalks have
    curbs, and there are no lines inside junctions (ours).
    """
    message = ground_truth.lane_boundary.add()
    message.id.value = numbers.of("boundary", lane.id, str(side))
    kinds = osi3().osi_lane_pb2.LaneBoundary.Classification
    width_m, height_m = LINE_WIDTH_M, 0.0
    message.classification.color = kinds.COLOR_WHITE
    if lane.internal or (other is None and "pedestrian" in lane.kinds):
        message.classification.type, width_m = kinds.TYPE_NO_LINE, 0.0
    elif other is not None and not _share(lane, other):
        message.classification.type, height_m = kinds.TYPE_CURB, CURB_M
    elif other is not None and "car" in lane.kinds and "car" in other.kinds:
        message.classification.type = kinds.TYPE_DASHED_LINE
    else:
        message.classification.type = kinds.TYPE_SOLID_LINE
    if message.classification.type in (kinds.TYPE_NO_LINE, kinds.TYPE_CURB):
        message.classification.color = kinds.COLOR_NONE
    for x, y in shifted(lane.shape, side * lane.width_m / 2):
        point = message.boundary_line.add()
        set_vector(point.position, x, y)
        point.width, point.height = width_m, height_m
    return int(message.id.value)


def _add_building(message: Any, outline: Points, k: int, numbers: Numbers) -> None:  # noqa: ANN401
    facts = osi3().osi_object_pb2.StationaryObject.Classification
    message.id.value = numbers.of("building", str(k))
    message.classification.type, message.classification.density = facts.TYPE_BUILDING, facts.DENSITY_SOLID
    corners = np.asarray(outline, dtype=np.float64)
    low, high = corners.min(axis=0), corners.max(axis=0)
    centre = (low + high) / 2
    set_size(message.base.dimension, high[0] - low[0], high[1] - low[1], BUILDING_HEIGHT_M)
    set_vector(message.base.position, centre[0], centre[1], BUILDING_HEIGHT_M / 2)
    set_yaw(message.base.orientation, 0.0)
    for x, y in corners - centre:
        point = message.base.base_polygon.add()
        point.x, point.y = float(x), float(y)

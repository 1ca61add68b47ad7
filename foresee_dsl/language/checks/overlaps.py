"""Checks of the objects of one edge against each other: each needs room of its own, and the lanes at its place."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from foresee_dsl.helps import remove, write
from foresee_dsl.language import model as m
from foresee_dsl.language.messages.collector import Collector
from foresee_dsl.language.streets.layout import Cut, Directed, lanes_of
from foresee_dsl.language.streets.lines import number

APART_M = 3.0
"""Minimum distance between two objects on one edge, m. Each object cuts the edge into pieces (ours: the joint of two
pieces is 1 m long)."""


def check_overlaps(collector: Collector, edges: Iterable[Directed], order: Sequence[m.Item]) -> None:
    """Report the first object of each edge that overlaps another or has no lane; `order`: the network's statements.

    Of two objects, the later statement is reported.
    """
    for edge in edges:
        if not _in_a_bay(collector, edge, order):
            _along(collector, edge, order)


def _along(collector: Collector, edge: Directed, order: Sequence[m.Item]) -> None:
    """Report objects of one edge that overlap, and lanes that do not exist."""
    first, last = 1, lanes_of(edge.road)[1 if edge.back else 0]
    open_ramp: Cut | None = None
    for k, cut in enumerate(edge.cuts):
        item = cut.item
        before = edge.cuts[max(k - 1, 0)]
        gap_m = cut.at_m - before.at_m - APART_M - _half(before.item) - _half(item)
        if item is not before.item and gap_m < 0:
            late = max(item, before.item, key=order.index)
            early = before.item if late is item else item
            apart = APART_M + _half(early) + _half(late)
            message = f"this is too close to {called(early)}: the two are {abs(cut.at_m - before.at_m):.1f} m apart"
            free = number(early.at) + math.copysign(math.ceil(apart), number(late.at) - number(early.at) or 1)
            collector.add(
                late, "at", "FS270", message, "leave room between them, for example with " + write(f"{free:g} m")
            )
            return
        if isinstance(item, m.OnRamp | m.OffRamp):
            if not cut.last and open_ramp is not None:
                message = f"its extra lane overlaps that of {called(open_ramp.item)}"
                help = "move one, so that it ends before the other begins, or " + remove("remove one")
                collector.add(item, "at", "FS270", message, help)
                return
            open_ramp = None if cut.last else cut
        elif isinstance(item, m.LaneEnd):
            if open_ramp is not None:
                help = "move the end of the lane before or behind the ramp's extra lane, or " + remove("remove it")
                message = f"a lane ends beside the extra lane of {called(open_ramp.item)}"
                collector.add(item, "at", "FS270", message, help)
                return
            count, lane = last - first + 1, round(number(item.lane))
            if count < 2 or lane not in (1, count):
                some = (
                    "only an outer lane can end: " + write("1") + " (the rightmost) or " + write(f"{count}")
                    if count > 1
                    else "the only lane cannot end: " + remove("remove this")
                )
                lanes = f"{count} lanes" if count > 1 else "one lane"
                message = f"lane {lane} of '{edge.id}' cannot end there: the road has {lanes} at that place"
                collector.add(item, "lane", "FS270", message, some)
                return
            first, last = (first + 1, last) if lane == 1 else (first, last - 1)


def _in_a_bay(collector: Collector, edge: Directed, order: Sequence[m.Item]) -> bool:
    """Report an object in the bay of a bus stop, or right beside it; return whether there is one."""
    spans: list[tuple[m.Item, float, float]] = []
    for item in dict.fromkeys(cut.item for cut in edge.cuts):
        at = [cut.at_m for cut in edge.cuts if cut.item == item]
        spans.append((item, at[0] - _half(item), at[-1] + _half(item)))
    for bay, begin_m, end_m in spans:
        for other, first_m, last_m in spans:
            near = other is not bay and first_m < end_m + APART_M and last_m > begin_m - APART_M
            if isinstance(bay, m.BusStop) and near:
                late = max(bay, other, key=order.index)
                reach = f"which reaches from {begin_m:g} m to {end_m:g} m of '{edge.id}'"
                where = f"the bay of {called(bay)}" if late is other else "this bay"
                message = f"{called(other)} is inside or too close to {where}, {reach}"
                apart = f"leave {APART_M:g} m between the two, or "
                collector.add(late, "at", "FS270", message, apart + remove("remove one"))
                return True
    return False


def called(item: m.Item) -> str:
    """Return the name of an object for messages."""
    name = getattr(item, "name", "")
    return f"'{name}'" if name else f"the end of lane {number(getattr(item, 'lane', None)):g}"


def _half(item: m.Item) -> float:
    """Return half the length that an object covers along its road, m."""
    return number(item.width, 4.0) / 2 if isinstance(item, m.Zebra) else 0.0

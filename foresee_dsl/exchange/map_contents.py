"""What an OpenDRIVE map holds, as far as it is taken over, and what is not."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from foresee_dsl.compile.netparts import NetParts

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

_LIGHTS = ("1000001", "1000002", "1000009", "1000010", "1000011")
"""OpenDRIVE's types of traffic lights (annex of ASAM OpenDRIVE 1.4 to 1.8, country `OpenDRIVE`; from memory, not
checked; netconvert reads them as such)."""
_LEVEL_M = 0.01


def taken_from(parts: NetParts) -> dict[str, int]:
    """Return what a net has, in words."""
    lanes = [lane for edge in parts.edges.values() for lane in edge.lanes]
    return {
        "edges": len(parts.edges),
        "lanes for cars": sum("car" in lane.kinds for lane in lanes),
        "sidewalks": sum(lane.kinds == {"pedestrian"} for lane in lanes),
        "junctions": len({edge.end for edge in parts.edges.values()}),
        "junctions with a signal": len({m.junction for m in parts.movements if m.tls is not None}),
        "crossings": len(parts.crossings),
    }


def left_out_of(root: Element) -> Counter[str]:
    """Return what an OpenDRIVE map holds and the world does not, with counts."""
    found: Counter[str] = Counter()
    for signal in root.iter("signal"):
        if signal.get("type") not in _LIGHTS:
            found["signs (who goes first is worked out from the roads)"] += 1
    for thing in root.iter("object"):
        crosswalk = thing.get("type") == "crosswalk"
        found["crosswalk objects (crossings are guessed from the sidewalks)" if crosswalk else "objects"] += 1
    for lane in root.iter("lane"):
        kind = lane.get("type", "none")
        if kind not in ("driving", "sidewalk", "none", "bidirectional", "biking"):
            found[f"lanes of type {kind}"] += 1
    for profile in root.iter("elevation"):
        steep = any(abs(float(profile.get(key, "0") or 0)) > _LEVEL_M for key in ("a", "b", "c", "d"))
        found["stretches with a height or slope (the world is flat)"] += steep
    found["tables of signal controllers"] += sum(1 for _ in root.iterfind("controller"))
    return +found


def notes_on(root: Element, parts: NetParts) -> tuple[str, ...]:
    """Return what we added to a map, a sentence each."""
    notes = []
    if any(m.tls is not None for m in parts.movements):
        notes.append("the map says where signals are, not what they show: each got a program of ours with a stage for "
                     "each pair of opposite approaches (20 s green, 3 s amber, 2 s all red)")  # fmt: skip
    if parts.crossings:
        notes.append(f"{len(parts.crossings)} pedestrian crossings are guessed: at junctions, where sidewalks end")
    if root.find("road/type/speed") is None and root.find(".//lane/speed") is None:
        notes.append("the map has no speed limits: 50 km/h everywhere (netconvert's)")
    return tuple(notes)

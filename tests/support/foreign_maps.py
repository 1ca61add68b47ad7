"""Small maps of other tools by hand: SUMO nets and OpenDRIVE maps, with errors or like CARLA's larger towns."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

HILL_ROAD = Path(__file__).with_name("hill_road.xodr")
STRAIGHT = "100,0 106,0"


def net(
    inner: str = STRAIGHT, *, first: str = "0,0 100,0", second: str = "106,0 200,0", width: str = "3.2", more: str = ""
) -> str:
    """A net of two edges `in` and `out` of one lane, with one connection between them; `more`: further edges."""
    return f"""<net version="1.20">
  <location netOffset="0,0" convBoundary="0,0,200,0" origBoundary="0,0,200,0" projParameter="!"/>
  <edge id=":j_0" function="internal">
    <lane id=":j_0_0" index="0" speed="9" length="6" shape="{inner}"/>
  </edge>
  <edge id="in" from="a" to="j"><lane id="in_0" index="0" speed="9" length="100" shape="{first}"/></edge>
  <edge id="out" from="j" to="b">
    <lane id="out_0" index="0" speed="9" length="94" width="{width}" shape="{second}"/>
  </edge>{more}
  <junction id="a" type="dead_end" x="0" y="0" incLanes="" intLanes="" shape="0,-1.6 0,1.6"/>
  <junction id="j" type="priority" x="103" y="0" incLanes="in_0" intLanes=":j_0_0"
    shape="100,-1.6 106,-1.6 106,1.6 100,1.6"><request index="0" response="0" foes="0"/></junction>
  <junction id="b" type="dead_end" x="200" y="0" incLanes="out_0" intLanes="" shape="200,-1.6 200,1.6"/>
  <connection from="in" to="out" fromLane="0" toLane="0" via=":j_0_0" dir="s" state="M"/>
  <connection from=":j_0" to="out" fromLane="0" toLane="0" dir="s" state="M"/>
</net>"""


@dataclass(frozen=True)
class Road:
    """A straight road: where it begins (m), its heading (degrees), its length (m), and what its lanes are.

    `left` and `right` are types of lanes from the middle outwards. `heights`: (s, a, b) of its elevation profile.
    `before` and `behind`: (road or junction, id, contact) of its neighbours.
    """

    id: str
    x: float
    y: float
    heading_deg: float
    length: float
    right: Sequence[str] = ("driving",)
    left: Sequence[str] = ("driving",)
    heights: Sequence[tuple[float, float, float]] = ()
    before: tuple[str, str, str] | None = None
    behind: tuple[str, str, str] | None = None
    speed: float = 30.0
    objects: str = ""
    signals: str = ""

    def at(self, s: float, t: float = 0.0) -> dict[str, float]:
        """A place on it, `t` to the left of its reference line, as CARLA says it, in the road's direction."""
        h = math.radians(self.heading_deg)
        z = next((a + b * (s - at) for at, a, b in reversed(self.heights) if at <= s), 0.0)
        x, y = self.x + s * math.cos(h) - t * math.sin(h), self.y + s * math.sin(h) + t * math.cos(h)
        return {"x": x, "y": -y, "z": z, "pitch": 0.0, "roll": 0.0, "yaw": -self.heading_deg}

    @property
    def xml(self) -> str:
        """The road in OpenDRIVE."""
        profile = "".join(f'<elevation s="{s}" a="{a}" b="{b}" c="0" d="0"/>' for s, a, b in self.heights)
        ends = ""
        for tag, end in (("predecessor", self.before), ("successor", self.behind)):
            if end is not None:
                contact = f' contactPoint="{end[2]}"' if end[2] else ""
                ends += f'<{tag} elementType="{end[0]}" elementId="{end[1]}"{contact}/>'
        return f"""<road name="" length="{self.length}" id="{self.id}" junction="-1">
  <link>{ends}</link>
  <type s="0" type="town"><speed max="{self.speed}" unit="mph"/></type>
  <planView><geometry s="0" x="{self.x}" y="{self.y}" hdg="{math.radians(self.heading_deg)}" length="{self.length}">
    <line/></geometry></planView>
  <elevationProfile>{profile}</elevationProfile>
  <lanes><laneSection s="0">
    <left>{_lanes(self.left, 1)}</left>
    <center><lane id="0" type="none" level="false"/></center>
    <right>{_lanes(self.right, -1)}</right>
  </laneSection></lanes>
  <objects>{self.objects}</objects>
  <signals>{self.signals}</signals>
</road>"""


def _lanes(kinds: Sequence[str], side: int) -> str:
    numbered = [(side * (k + 1), kind) for k, kind in enumerate(kinds)]
    if side > 0:
        numbered.reverse()
    lanes = ""
    for number, kind in numbered:
        width = 2.0 if kind == "sidewalk" else 3.5
        link = f'<link><predecessor id="{number}"/><successor id="{number}"/></link>'
        wide = f'<width sOffset="0" a="{width}" b="0" c="0" d="0"/>'
        lanes += f'<lane id="{number}" type="{kind}" level="false">{link}{wide}</lane>'
    return lanes


def write_map(path: Path, *roads: Road, junctions: str = "") -> Path:
    """Write a map of some roads."""
    header = '<header revMajor="1" revMinor="4" name="" version="1" north="0" south="0" east="0" west="0"/>'
    body = "".join(road.xml for road in roads)
    path.write_text(f"<?xml version='1.0'?><OpenDRIVE>{header}{body}{junctions}</OpenDRIVE>", encoding="utf-8")
    return path


LANE = '<lane id="{id}" type="driving" level="false"><width sOffset="0" a="{width}" b="0" c="0" d="0"/></lane>'


def road(
    *, id: str = "1", x: float = 0, length: float = 60, piece: str = "<line/>", links: str = "", right: int = 1,
    more: str = "", attributes: str = "", left: int = 0,
) -> str:  # fmt: skip
    """An OpenDRIVE road to the east, of one piece, with lanes of 3.5 m."""

    def lanes(numbers: range) -> str:
        return "".join(LANE.format(id=k, width=3.5) for k in numbers)

    return f"""<road name="" length="{length}" id="{id}" junction="-1" {attributes}><link>{links}</link>
  <planView><geometry s="0" x="{x}" y="0" hdg="0" length="{length}">{piece}</geometry></planView>
  <lanes><laneSection s="0"><left>{lanes(range(left, 0, -1))}</left><center><lane id="0" type="none"/></center>
  <right>{lanes(range(-1, -right - 1, -1))}</right></laneSection></lanes>{more}</road>"""


def opendrive(*parts: str, namespace: str = "") -> str:
    """An OpenDRIVE map of roads and junctions."""
    inner = "".join(parts)
    return f'<?xml version="1.0"?><OpenDRIVE{namespace}><header revMajor="1" revMinor="6"/>{inner}</OpenDRIVE>'

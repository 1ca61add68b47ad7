"""Small SUMO nets and OpenDRIVE maps by hand, with something that others' maps have wrong."""

from __future__ import annotations

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

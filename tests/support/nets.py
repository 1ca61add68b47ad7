"""Small networks for the simulation tests, built with netconvert, and vehicle models to put on them."""

from __future__ import annotations

import subprocess
from pathlib import Path

import sumo

from foresee_dsl.compile.bundle import ModelSpec

COMPACT = ModelSpec("car.compact", "car", 4.0, 1.75, 2.5, 0.8, 1100.0, 50.0, 3.0, 4.5, 8.0, 0.61, 7.0)
VAN = ModelSpec("van.delivery", "van", 5.9, 2.0, 3.6, 0.95, 2500.0, 45.0, 2.0, 4.0, 7.0, 0.58, 6.0)
ADULT = ModelSpec("pedestrian.adult", "pedestrian", 0.5, 0.6, 0.5, 0.0, 75.0, 3.0, 1.5, 2.0, 3.0, 0.5, 7.0)
CRATE = ModelSpec("obstacle.crate", "obstacle", 1.0, 1.2, 1.0, 0.0, 50.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

_TYPES = """<additional>
<vType id="car.compact" length="4.0" width="1.75" accel="3.0" decel="4.5" emergencyDecel="8.0" maxSpeed="50"
  minGap="2.0" sigma="0" speedDev="0"/>
<vType id="van.delivery" vClass="delivery" length="5.9" width="2.0" accel="2.0" decel="4.0" emergencyDecel="7.0"
  maxSpeed="45" minGap="2.0" sigma="0" speedDev="0"/>
<vType id="ghost" length="0.5" width="0.5" minGap="0" sigma="0" speedDev="0" accel="5" decel="5" maxSpeed="50"/>
</additional>
"""


def grid_edges(columns: int, rows: int) -> list[tuple[str, str]]:
    """Both directions of every street of a grid whose junctions are called `n<column><row>`."""
    ends = []
    for c in range(columns):
        for r in range(rows):
            if c + 1 < columns:
                ends.append((f"n{c}{r}", f"n{c + 1}{r}"))
            if r + 1 < rows:
                ends.append((f"n{c}{r}", f"n{c}{r + 1}"))
    return [e for a, b in ends for e in ((a, b), (b, a))]


def build_grid(folder: Path, columns: int = 4, rows: int = 4, spacing_m: float = 110.0) -> tuple[Path, Path]:
    """A town-like grid: signals where column + row is even inside, priority elsewhere; the middle row has two lanes.

    Returns:
        The network's and the vehicle types' file.
    """
    inside = {(c, r) for c in range(1, columns - 1) for r in range(1, rows - 1)}
    nodes = "".join(
        f'<node id="n{c}{r}" x="{c * spacing_m}" y="{r * spacing_m}" '
        f'type="{"traffic_light" if (c, r) in inside and (c + r) % 2 == 0 else "priority"}"/>\n'
        for c in range(columns)
        for r in range(rows)
    )
    edges = "".join(
        f'<edge id="{a}_{b}" from="{a}" to="{b}" numLanes="{2 if a[2] == b[2] == "1" else 1}" speed="13.89" '
        f'priority="{2 if a[2] == b[2] else 1}" sidewalkWidth="2"/>\n'
        for a, b in grid_edges(columns, rows)
    )
    return convert(folder, f"<nodes>{nodes}</nodes>", f"<edges>{edges}</edges>")


def convert(folder: Path, nodes: str, edges: str) -> tuple[Path, Path]:
    """Run netconvert on plain XML texts."""
    (folder / "t.nod.xml").write_text(nodes)
    (folder / "t.edg.xml").write_text(edges)
    (folder / "types.add.xml").write_text(_TYPES)
    net = folder / "t.net.xml"
    subprocess.run(
        [
            str(Path(sumo.SUMO_HOME) / "bin" / "netconvert"),
            *("--node-files", str(folder / "t.nod.xml"), "--edge-files", str(folder / "t.edg.xml")),
            *("--output-file", str(net), "--crossings.guess", "--walkingareas", "--no-turnarounds"),
            *("--junctions.limit-turn-speed", "5.5", "--tls.green.time", "15", "--no-warnings"),
        ],
        check=True,
        capture_output=True,
    )
    return net, folder / "types.add.xml"

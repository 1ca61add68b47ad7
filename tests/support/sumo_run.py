"""Runs nets in SUMO, each in a process of its own, because libsumo allows one SUMO a process: `sumo_run.py NET ROUTES
SECONDS [ADDITIONAL]` prints what happened as JSON."""

import json
import subprocess
import sys
from collections import Counter
from itertools import product
from pathlib import Path


def main(net: str, routes: str, seconds: str, additional: str = "") -> None:
    import libsumo

    options = ["sumo", "-n", net, "-r", routes, "--step-length", "0.05", "--no-step-log", "--seed", "1"]
    options += ["--collision.check-junctions", "true", "--collision.action", "warn", "--time-to-teleport", "-1"]
    options += ["--collision.mingap-factor", "0"]  # bodies that touch, not gaps that are short
    libsumo.start(options + (["-a", additional] if additional else []))
    collisions, arrived, walked = [], set(), set()
    light = {}
    while libsumo.simulation.getTime() < float(seconds):
        libsumo.simulationStep()
        collisions += [(c.collider, c.victim, c.lane) for c in libsumo.simulation.getCollisions()]
        arrived |= set(libsumo.simulation.getArrivedIDList())
        walked |= set(libsumo.simulation.getArrivedPersonIDList())
        for tls in libsumo.trafficlight.getIDList():
            light.setdefault(tls, []).append(libsumo.trafficlight.getRedYellowGreenState(tls))
    states = {tls: [s for k, s in enumerate(seen) if k == 0 or seen[k - 1] != s] for tls, seen in light.items()}
    result = {
        "collisions": sorted(set(collisions)),
        "arrived": sorted(arrived),
        "walked": sorted(walked),
        "still": libsumo.vehicle.getIDCount(),
        "states": states,
    }
    libsumo.close()
    sys.stdout.write(json.dumps(result) + "\n")


def dead_ends(network):
    """Return the names of the roads that begin at a place without other roads."""
    from foresee_dsl.language.model import Road

    roads = [item for item in network.body if isinstance(item, Road)]
    touched = Counter(end for item in roads for end in (item.start, item.end))
    return [item.name for item in roads if touched[item.start] == 1]


def drive_everywhere(
    network, net: Path, folder: Path, *, seconds: int, period: float, walkers: bool, reckless=False
) -> dict:
    """Send cars from every dead end to every other one (and people along the same ways) and run SUMO."""
    from foresee_dsl.compile.catalogue import spec_of
    from foresee_dsl.compile.sumo_files import types_of
    from foresee_dsl.language.model import VehicleModel
    from tests.support.worlds import q

    model = VehicleModel(name="car.plain", length=q(4.5), width=q(1.8))
    (folder / "types.add.xml").write_text(types_of([spec_of(model)]))
    if reckless:
        text = (folder / "types.add.xml").read_text()
        blind = 'jmIgnoreFoeProb="1" jmIgnoreFoeSpeed="99" jmIgnoreJunctionFoeProb="1" sigma='
        (folder / "types.add.xml").write_text(text.replace("sigma=", blind))
    roads = dead_ends(network)
    rows, people = [], []
    for a, b in ((a, b) for a, b in product(roads, roads) if a != b):
        flow = f'begin="0" end="{seconds // 2}" period="{period}" type="car.plain" departSpeed="max"'
        rows.append(f'<flow id="{a}-{b}" from="{a}" to="{b}_back" departLane="best" {flow}/>')
        people.append(f'<person id="{a}~{b}" depart="0" departPos="60"><walk from="{a}" to="{b}_back"/></person>')
    routes = folder / "all.rou.xml"
    routes.write_text("<routes>" + "".join(rows + (people if walkers else [])) + "</routes>")
    return run_sumo(net, routes, seconds, folder / "types.add.xml")


def run_sumo(net, routes, seconds, additional=None):
    files = [str(net), str(routes), str(seconds), *([str(additional)] if additional else [])]
    done = subprocess.run([sys.executable, __file__, *files], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


if __name__ == "__main__":
    main(*sys.argv[1:])

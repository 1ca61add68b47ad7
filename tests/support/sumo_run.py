"""Runs a net in SUMO and prints what happened as JSON; a program of its own, because libsumo allows one SUMO a process.

Usage: sumo_run.py NET ROUTES SECONDS [ADDITIONAL]
"""

import json
import sys

import libsumo


def main(net: str, routes: str, seconds: str, additional: str = "") -> None:
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


main(*sys.argv[1:])

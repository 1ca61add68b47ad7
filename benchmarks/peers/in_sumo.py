"""SUMO alone, through TraCI: the benchmark's state is loaded and stepped, and all vehicles are read in each step.

Arguments: the scene's folder, steps, rounds, `getters` or `subscriptions`. Prints JSON.
"""

from __future__ import annotations

import json
import os
import shutil
import sys
import time
from pathlib import Path

import sumo
import traci
from traci import constants


def main(folder: Path, steps: int, rounds: int, how: str) -> None:
    """Print the CPU time of this process and of SUMO for one round."""
    binary = shutil.which("sumo") or str(Path(sumo.SUMO_HOME) / "bin" / "sumo")
    files = ["-n", str(folder / "scene.net.xml"), "-a", str(folder / "types.xml")]
    traci.start([binary, *files, "--step-length", "0.05", "--collision.action", "none", "--no-step-log",
                 "--no-warnings", "--time-to-teleport", "-1"])  # fmt: skip
    process = traci.getConnection()._process
    actors = _round(folder, steps, how)
    began_s, began_here_s = _cpu_s(process.pid), time.process_time()
    for _ in range(rounds):
        _round(folder, steps, how)
    spent_s = _cpu_s(process.pid) - began_s + time.process_time() - began_here_s
    traci.close()
    sys.stdout.write(json.dumps({"cpu_s": spent_s / rounds, "actors": actors}))


def _round(folder: Path, steps: int, how: str) -> int:
    vehicle = traci.vehicle
    traci.simulation.loadState(str(folder / "state.xml"))
    if how == "subscriptions":
        for name in vehicle.getIDList():
            vehicle.subscribe(name, (constants.VAR_POSITION, constants.VAR_SPEED, constants.VAR_ANGLE))
    actors = len(vehicle.getIDList())
    for _ in range(steps):
        traci.simulationStep()
        if how == "subscriptions":
            vehicle.getAllSubscriptionResults()
            continue
        for name in vehicle.getIDList():
            vehicle.getPosition(name)
            vehicle.getSpeed(name)
            vehicle.getAngle(name)
    return actors


def _cpu_s(pid: int) -> float:
    """Return the CPU time of a process so far, s."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]), sys.argv[4])

"""commonroad-sumo: its simulation without a planner, which reads all vehicles into a CommonRoad scenario in each step.

Arguments: the scene's folder, steps, rounds. Prints JSON.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

from commonroad.scenario.scenario import Scenario, ScenarioID
from commonroad_sumo import NonInteractiveSumoSimulation, SumoProject


def main(folder: Path, steps: int, rounds: int) -> None:
    """Print the CPU time of one round, with SUMO's start, which the tool cannot avoid."""
    actors = _round(folder, steps)
    began_s = time.process_time()
    for _ in range(rounds):
        _round(folder, steps)
    spent_s = (time.process_time() - began_s) / rounds
    sys.stdout.write(json.dumps({"cpu_s": spent_s, "actors": actors}))


def _round(folder: Path, steps: int) -> int:
    scenario = Scenario(0.05, ScenarioID())
    result = NonInteractiveSumoSimulation(scenario, SumoProject("scene", folder)).run(steps)
    return len(result.scenario.dynamic_obstacles)


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))

"""Scenic's own simulator in two dimensions (Newtonian), without a window.

Arguments: the scene's folder, steps, rounds, actors. Prints JSON.
"""

from __future__ import annotations

import json
import random
import sys
import time
from pathlib import Path

import numpy as np
import scenic


def main(folder: Path, steps: int, rounds: int, actors: int) -> None:
    """Print the CPU time of one round, without generating the scene."""
    random.seed(1)
    np.random.seed(1)
    scenario = scenic.scenarioFromFile(
        str(Path(__file__).parent / "scene.scenic"),
        params={"map": str(folder / "map.xodr"), "render": False, "others": actors - 1},
        mode2D=True,
    )
    scene, _ = scenario.generate(maxIterations=20_000)
    simulator = scenario.getSimulator()
    spent_s = []
    for _ in range(rounds):
        began_s = time.process_time()
        done = simulator.simulate(scene, maxSteps=steps, timestep=0.05, maxIterations=1)
        spent_s.append(time.process_time() - began_s)
        if done is None or done.currentTime < steps:
            raise RuntimeError("the simulation ended early")
    sys.stdout.write(json.dumps({"cpu_s": min(spent_s), "actors": len(scene.objects)}))


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4]))

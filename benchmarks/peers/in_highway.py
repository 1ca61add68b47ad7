"""highway-env: its straight road with the same number of vehicles, which follow each other; 20 steps/s, no drawing.

Arguments: steps, rounds, actors. Prints JSON.
"""

from __future__ import annotations

import json
import sys
import time

import gymnasium
import highway_env

IDLE = 1
SETTINGS = {
    "lanes_count": 4,
    "simulation_frequency": 20,
    "policy_frequency": 20,
    "duration": 60,
    "offscreen_rendering": True,
}


def main(steps: int, rounds: int, actors: int) -> None:
    """Print the CPU time of one round with its reset."""
    gymnasium.register_envs(highway_env)
    seen = {"type": "Kinematics", "vehicles_count": actors}
    env = gymnasium.make(
        "highway-v0", config={**SETTINGS, "vehicles_count": actors - 1, "observation": seen}, disable_env_checker=True
    )
    spent_s = []
    for _ in range(rounds + 1):
        began_s, done = time.process_time(), 0
        while done < steps:  # restarts after a collision of the ego
            env.reset(seed=1 + done)
            for _ in range(done, steps):
                _, _, ended, cut, _ = env.step(IDLE)
                done += 1
                if ended or cut:
                    break
        spent_s.append(time.process_time() - began_s)
    sys.stdout.write(json.dumps({"cpu_s": min(spent_s[1:]), "actors": len(env.unwrapped.road.vehicles)}))


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))

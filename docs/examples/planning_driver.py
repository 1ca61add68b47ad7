"""An external driver for foresee that plans: a trajectory along its lane every 0.2 s, which the simulator follows."""

import json
import math
import sys

STEP_S, AHEAD_S = 0.1, 3.0


def plan(mission, vehicle, seen):
    """Return where to be in the next 3 s: on the centreline, below the limit, slow in bends, stopping at red."""
    ego, line, s = seen["ego"], mission["centreline"], mission["s"]
    here = min(range(len(line)), key=lambda k: math.dist(line[k], (ego["x"], ego["y"])))
    dx, dy, heading = ego["x"] - line[here][0], ego["y"] - line[here][1], ego["heading_rad"]
    begin, room = s[here] + dx * math.cos(heading) + dy * math.sin(heading), math.inf
    for j in mission["junctions"]:
        stop = j["stop_s"] - vehicle["length_m"] / 2 - 1
        if seen["signals"].get(j["signal"]) in ("red", "amber") and stop > s[here]:
            room = min(room, stop)
    for a in seen["actors"]:
        near = min(range(len(line)), key=lambda k: math.dist(line[k], (a["x"], a["y"])))
        if s[near] > s[here] and math.dist(line[near], (a["x"], a["y"])) < 2:
            room = min(room, s[near] - (a["length_m"] + vehicle["length_m"]) / 2 - 3)
    at, speed, k, points, speeds = begin, ego["speed_mps"], max(here - 1, 0), [], []
    for _ in range(round(AHEAD_S / STEP_S) + 1):
        while k < len(line) - 2 and s[k + 1] <= at:
            k += 1
        share = min((at - s[k]) / (s[k + 1] - s[k]), 1.0)
        points.append([a + share * (b - a) for a, b in zip(line[k], line[k + 1], strict=True)])
        speeds.append(speed)
        far, next_ = min(k + 10, len(line) - 1), min(k + 11, len(line) - 1)
        (x0, y0), (x1, y1), (x2, y2), (x3, y3) = line[k], line[k + 1], line[far], line[next_]
        bend = abs(math.remainder(math.atan2(y3 - y2, x3 - x2) - math.atan2(y1 - y0, x1 - x0), math.tau))
        fastest = min(mission["speed_limit_mps"][k], 13 / (1 + 2 * bend), math.sqrt(4 * max(room - at, 0)))
        after = max(speed + min(max(fastest - speed, -4 * STEP_S), 1.5 * STEP_S), 0)
        at, speed = at + (speed + after) / 2 * STEP_S, after
    times = [seen["time_s"] + n * STEP_S for n in range(len(points))]
    return {"time_s": times, "x": [p[0] for p in points], "y": [p[1] for p in points], "speed_mps": speeds}


for message in map(json.loads, sys.stdin):
    if message["type"] == "reset":
        task, car, steps = message["mission"], message["vehicle"], 0
        answer = {"type": "ready", "name": "planner", "version": "1"}
    elif message["type"] == "step":
        answer = {"trajectory": plan(task, car, message["observation"])} if steps % 4 == 0 else {"keep": True}
        steps += 1
    else:
        break
    print(json.dumps(answer), flush=True)

"""An external driver for foresee: keeps its lane, the limit and its distance, and stops at red. No libraries."""

import json
import math
import sys


def drive(mission, vehicle, seen):
    ego, line, s = seen["ego"], mission["centreline"], mission["s"]
    back = vehicle["wheelbase_m"] + vehicle["front_overhang_m"] - vehicle["length_m"] / 2
    x, y = ego["x"] - back * math.cos(ego["heading_rad"]), ego["y"] - back * math.sin(ego["heading_rad"])
    here = min(range(len(line)), key=lambda k: math.dist(line[k], (x, y)))
    aim = next((p for p, at in zip(line, s, strict=True) if at > s[here] + 4 + 0.5 * ego["speed_mps"]), line[-1])
    turn = math.atan2(aim[1] - y, aim[0] - x) - ego["heading_rad"]  # pure pursuit
    steer_rad = math.atan2(2 * vehicle["wheelbase_m"] * math.sin(turn), math.dist(aim, (x, y)))

    front, room = s[here] + back + vehicle["length_m"] / 2, 1e3
    for j in mission["junctions"]:
        if seen["signals"].get(j["signal"]) in ("red", "amber") and j["stop_s"] > front - 1:
            room = min(room, j["stop_s"] - 1 - front)
    for a in seen["actors"]:
        near = min(range(len(line)), key=lambda k: math.dist(line[k], (a["x"], a["y"])))
        if s[near] > front and math.dist(line[near], (a["x"], a["y"])) < 2:
            room = min(room, s[near] - a["length_m"] / 2 - 3 - front)
    far = next((p for p, at in zip(line, s, strict=True) if at > s[here] + 20), line[-1])
    bend = abs(math.remainder(math.atan2(far[1] - y, far[0] - x) - ego["heading_rad"], math.tau))
    fastest = mission["speed_limit_mps"][here] / (1 + 4 * bend)
    missing = min(fastest, math.sqrt(2 * 2.0 * max(room, 0))) - ego["speed_mps"]  # stops with 2 m/s^2
    steer = max(-1, min(steer_rad / vehicle["steer_max_rad"], 1))
    return {"steer": steer, "throttle": max(0, min(missing, 1)), "brake": max(0, min(-missing / 3, 1))}


for message in map(json.loads, sys.stdin):
    if message["type"] == "reset":
        task, car = message["mission"], message["vehicle"]
        answer = {"type": "ready", "name": "example", "version": "1"}
    elif message["type"] == "step":
        answer = drive(task, car, message["observation"])
    else:
        break
    print(json.dumps(answer), flush=True)

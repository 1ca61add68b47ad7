"""A driver for foresee: keeps its lane, limit and distance, stops at red, and brakes for actors that come into its way.

foresee writes lines of JSON to standard input; each is answered with one line. Text for people goes to standard error.
Replace `drive` by a call of your software. Coordinates: x east, y north, m; headings counter-clockwise from east, rad.
"""

import json
import math
import sys

BRAKING_MPS2 = 2.0  # comfortable; the pedal is pressed further if the ego is still too fast
GAP_M = 3.0  # to whatever it stops for
TIMES_S = (0.0, 0.5, 1.0, 1.5, 2.0)  # for which the motion of others is predicted


def drive(mission, car, seen):
    """Return steer from -1 (right) to 1 (left), throttle and brake from 0 to 1."""
    ego, line, s = seen["ego"], mission["centreline"], mission["s"]
    heading_rad, speed_mps = ego["heading_rad"], ego["speed_mps"]
    back_m = car["wheelbase_m"] + car["front_overhang_m"] - car["length_m"] / 2  # from the centre to the rear axle
    x, y = ego["x"] - back_m * math.cos(heading_rad), ego["y"] - back_m * math.sin(heading_rad)
    here = nearest(line, x, y)

    # Pure pursuit: the circle through the rear axle and a point ahead on the route.
    aim = point(line, s, s[here] + 4 + 0.5 * speed_mps)
    turn = math.remainder(math.atan2(aim[1] - y, aim[0] - x) - heading_rad, math.tau)
    wheels_rad = math.atan2(2 * car["wheelbase_m"] * math.sin(turn), math.dist(aim, (x, y)))

    far = point(line, s, s[here] + 20)
    bend = abs(math.remainder(math.atan2(far[1] - y, far[0] - x) - heading_rad, math.tau))
    limit_mps = mission["speed_limit_mps"][here] / (1 + 4 * bend)
    room_m = max(room(mission, car, seen, s[here] + back_m + car["length_m"] / 2), 0.0)
    missing_mps = min(limit_mps, math.sqrt(2 * BRAKING_MPS2 * room_m)) - speed_mps
    return {
        "steer": min(max(wheels_rad / car["steer_max_rad"], -1.0), 1.0),
        "throttle": min(max(missing_mps, 0.0), 1.0),
        "brake": min(max(-missing_mps / 3, 0.0), 1.0),
    }


def room(mission, car, seen, front_s):
    """Return the distance from the ego's front to where it has to stop, m."""
    room_m = 1000.0
    for junction in mission["junctions"]:
        if seen["signals"].get(junction["signal"]) in ("red", "amber") and junction["stop_s"] > front_s - 1:
            room_m = min(room_m, junction["stop_s"] - 1 - front_s)
    for actor in seen["actors"]:
        for ahead_s in TIMES_S:
            way_m = actor["speed_mps"] * ahead_s
            x = actor["x"] + way_m * math.cos(actor["heading_rad"])
            y = actor["y"] + way_m * math.sin(actor["heading_rad"])
            near = nearest(mission["centreline"], x, y)
            aside_m = math.dist(mission["centreline"][near], (x, y))
            away_m = mission["s"][near] - front_s
            in_way = aside_m < (actor["width_m"] + car["width_m"]) / 2 + 0.4 and away_m > 0
            same_time = abs(away_m / max(seen["ego"]["speed_mps"], 3.0) - ahead_s) < 1.5
            if in_way and (same_time or ahead_s == 0):
                half_m = actor["length_m"] / 2 if ahead_s == 0 else 0.0
                room_m = min(room_m, away_m - half_m - GAP_M)
    return room_m


def nearest(line, x, y):
    """Return the index of the route's point nearest to a place."""
    return min(range(len(line)), key=lambda k: (line[k][0] - x) ** 2 + (line[k][1] - y) ** 2)


def point(line, s, at_s):
    """Return the first point of the route from a length on, m."""
    return next((p for p, length in zip(line, s, strict=True) if length >= at_s), line[-1])


def main():
    """Answer each line until `end`."""
    mission = car = None
    for message in map(json.loads, sys.stdin):
        if message["type"] == "reset":
            mission, car = message["mission"], message["vehicle"]
            answer = {"type": "ready", "name": "my_driver", "version": "1"}
        elif message["type"] == "step":
            answer = drive(mission, car, message["observation"])
        else:
            break
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()

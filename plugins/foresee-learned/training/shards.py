"""Files of recorded runs: tables of numbers, rounded to steps that no picture shows, with the networks of the runs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from foresee_learned.rasters.ground import GroundMap
from numpy.typing import NDArray

from foresee_dsl.drivers.protocol import JunctionPassage, Mission, VehicleLimits
from foresee_dsl.kernels.arrays import FloatArray
from training.columns import packed, read_arrays, unpacked, write_arrays
from training.samples import EGO, LABELS, LINE, POINTS, SEEN, TRUE, RecordedNetwork, RecordedRun, Shape

FORMAT = 1
_STEPS: dict[str, dict[str, float]] = {
    "ego": {"x": 0.01, "y": 0.01, "heading": 0.001, "speed": 0.01, "acceleration": 0.05, "yaw_rate": 0.005,
            "steer": 0.002, "true_x": 0.01, "true_y": 0.01, "true_heading": 0.001},
    "seen": {"frame": 1.0, "track": 1.0, "kind": 1.0, "rank": 1.0, "x": 0.02, "y": 0.02, "heading": 0.02,
             "speed": 0.05, "length": 0.1, "width": 0.1},
    "true": {"frame": 1.0, "actor": 1.0, "in_sight": 1.0, "x": 0.02, "y": 0.02, "heading": 0.01, "speed": 0.1},
    "labels": {"frame": 1.0, "acceleration": 0.05, "steer": 0.005, "target_speed": 0.05, "stop": 1.0, "stop_m": 0.5,
               "signal": 1.0, "expert_drives": 1.0},
    "line": {"x": 0.01, "y": 0.01, "s": 0.01, "speed_limit": 0.01, "left": 0.02, "right": 0.02},
}  # fmt: skip
"""Rounding steps of the columns: a pixel of the pictures is 0.5 m, the noise of sensed places 0.1 m. Ours."""
_POINT_STEP = 0.02
_WHOLE = frozenset({"frame", "track", "kind", "rank", "actor", "in_sight", "stop", "signal", "expert_drives"})
_COLUMNS = {"ego": EGO, "seen": SEEN, "true": TRUE, "labels": LABELS, "line": LINE}


def write_shard(path: Path, runs: Sequence[RecordedRun], *, exact: bool = False) -> None:
    """Write runs; the same runs give the same bytes. `exact`: numbers are not rounded (for tests; ten times as
    large)."""
    networks: dict[str, RecordedNetwork] = {}
    for run in runs:
        networks.setdefault(run.network.key, run.network)
    arrays: dict[str, NDArray[Any]] = {}
    for key, network in networks.items():
        arrays[f"ground_{key}"] = network.ground.bits
    lines = [_line(run.mission) for run in runs]
    arrays |= _table("line", lines, exact)
    arrays |= _table("ego", [_true_relative(run.ego) for run in runs] if not exact else [r.ego for r in runs], exact)
    arrays |= _table("seen", [_by_track(run.seen) for run in runs], exact)
    arrays |= _table("true", [_by_track(run.true) for run in runs], exact)
    arrays |= _table("labels", [run.label_rows for run in runs], exact)
    points = np.concatenate([run.trajectories for run in runs]).reshape(-1, POINTS, 2)
    for axis, name in enumerate(("ahead", "left")):
        flat = points[:, :, axis] if exact else _bends(np.rint(points[:, :, axis] / _POINT_STEP))
        for j in range(POINTS):
            column = flat[:, j] if exact else np.cumsum(flat[:, j])  # values, not differences between frames
            arrays[f"points_{name}_{j}"] = packed(column, None if exact else 1.0)
    arrays["frames"] = packed(np.concatenate([run.frames[:, 0] for run in runs]), 1.0)
    arrays["ages"] = packed(np.concatenate([run.frames[:, 0] - run.frames[:, 1] for run in runs]), 1.0)
    colours = [run.colours.T.reshape(-1) for run in runs]
    arrays["colours"] = np.concatenate(colours) if colours else np.empty(0, np.uint8)
    about = {
        "format": FORMAT,
        "exact": exact,
        "networks": {
            key: {"west_m": n.ground.west_m, "north_m": n.ground.north_m, "m_per_px": n.ground.m_per_px,
                  "buildings": n.buildings}
            for key, n in networks.items()
        },
        "runs": [_about(run) for run in runs],
    }  # fmt: skip
    write_arrays(path, arrays, about)


def read_shard(path: Path) -> Iterator[RecordedRun]:
    """Yield the runs of a file."""
    arrays, about = read_arrays(path)
    if about["format"] != FORMAT:
        raise ValueError(f"{path} has format {about['format']}, and this reads format {FORMAT}")
    exact = about["exact"]
    networks = {
        key: RecordedNetwork(
            key,
            GroundMap(arrays[f"ground_{key}"], entry["west_m"], entry["north_m"], entry["m_per_px"]),
            tuple(tuple((x, y) for x, y in outline) for outline in entry["buildings"]),
        )
        for key, entry in about["networks"].items()
    }
    tables = {name: _columns(arrays, name, exact) for name in _COLUMNS}
    points = np.stack([_points(arrays, name, exact) for name in ("ahead", "left")], axis=2)
    frames, ages = unpacked(arrays["frames"], 1.0), unpacked(arrays["ages"], 1.0)
    at = dict.fromkeys([*_COLUMNS, "colours"], 0)

    def take(name: str, count: int) -> FloatArray:
        at[name] += count
        return tables[name][at[name] - count : at[name]]

    for entry in about["runs"]:
        counts = entry["counts"]
        first, labels = at["ego"], at["labels"]
        mission, ego = _mission(take("line", counts["line"]), entry), take("ego", counts["ego"])
        if not exact:
            ego = np.column_stack((ego[:, :7], ego[:, 7:] + ego[:, :3]))
        when = frames[first : first + counts["ego"]]
        age = ages[first : first + counts["ego"]]
        size = counts["ego"] * len(mission.junctions)
        colours = arrays["colours"][at["colours"] : at["colours"] + size].reshape(len(mission.junctions), -1).T
        at["colours"] += size
        yield RecordedRun(
            about=entry["about"],
            mission=mission,
            vehicle=VehicleLimits(**entry["vehicle"]),
            network=networks[entry["network"]],
            shapes=tuple(Shape(*shape) for shape in entry["shapes"]),
            range_m=entry["range_m"],
            frames=np.column_stack((when, when - age)).astype(np.int64),
            ego=ego,
            colours=colours.reshape(counts["ego"], len(mission.junctions)),
            seen=_by_frame(take("seen", counts["seen"]), 3),
            true=_by_frame(take("true", counts["true"]), 1),
            label_rows=take("labels", counts["labels"]),
            trajectories=points[labels : labels + counts["labels"]],
        )


def _about(run: RecordedRun) -> dict[str, Any]:
    m = run.mission
    return {
        "about": run.about,
        "counts": {"line": len(m.s), "ego": len(run.ego), "seen": len(run.seen), "true": len(run.true),
                   "labels": len(run.label_rows)},
        "vehicle": asdict(run.vehicle),
        "network": run.network.key,
        "shapes": [(shape.kind, shape.length_m, shape.width_m, shape.height_m) for shape in run.shapes],
        "range_m": run.range_m,
        "start_s": m.start_s,
        "goal_s": m.goal_s,
        "step_s": m.step_s,
        "junctions": [(j.junction, j.stop_s, j.exit_s, j.turn, j.signal) for j in m.junctions],
    }  # fmt: skip


def _line(mission: Mission) -> FloatArray:
    m = mission
    return np.column_stack((m.centreline, m.s, m.speed_limit_mps, m.left_m, m.right_m))


def _mission(line: FloatArray, entry: dict[str, Any]) -> Mission:
    return Mission(
        centreline=line[:, :2].copy(),
        s=line[:, 2].copy(),
        speed_limit_mps=line[:, 3].copy(),
        left_m=line[:, 4].copy(),
        right_m=line[:, 5].copy(),
        start_s=entry["start_s"],
        goal_s=entry["goal_s"],
        junctions=tuple(JunctionPassage(*passage) for passage in entry["junctions"]),
        step_s=entry["step_s"],
    )


def _table(name: str, parts: Sequence[FloatArray], exact: bool) -> dict[str, NDArray[Any]]:
    columns = _COLUMNS[name]
    rows = np.concatenate([np.empty((0, len(columns))), *parts])
    steps = _STEPS[name]
    return {
        f"{name}_{column}": packed(rows[:, k], None if exact and column not in _WHOLE else steps[column])
        for k, column in enumerate(columns)
    }


def _columns(arrays: dict[str, NDArray[Any]], name: str, exact: bool) -> FloatArray:
    steps = _STEPS[name]
    return np.column_stack(
        [unpacked(arrays[f"{name}_{c}"], None if exact and c not in _WHOLE else steps[c]) for c in _COLUMNS[name]]
    )


def _true_relative(ego: FloatArray) -> FloatArray:
    """Return the true pose as differences from the estimated one: small numbers."""
    steps = np.array([_STEPS["ego"][name] for name in ("x", "y", "heading")])
    estimated = np.rint(ego[:, :3] / steps) * steps  # as a reader of the file gets it
    return np.column_stack((ego[:, :7], ego[:, 7:] - estimated))


def _by_track(rows: FloatArray) -> FloatArray:
    """Return rows by actor (or track) and frame."""
    return rows[np.lexsort((rows[:, 0], rows[:, 1]))]


def _by_frame(rows: FloatArray, second: int) -> FloatArray:
    return rows[np.lexsort((rows[:, second], rows[:, 0]))]


def _bends(points: FloatArray) -> FloatArray:
    """Return [L, P] whole numbers as second differences along the trajectory."""
    return np.diff(np.diff(points, axis=1, prepend=0.0), axis=1, prepend=0.0)


def _points(arrays: dict[str, NDArray[Any]], name: str, exact: bool) -> FloatArray:
    columns = [unpacked(arrays[f"points_{name}_{j}"], None if exact else 1.0) for j in range(POINTS)]
    if exact:
        return np.stack(columns, axis=1)
    bends = np.stack([np.diff(column, prepend=0.0) for column in columns], axis=1)
    return np.cumsum(np.cumsum(bends, axis=1), axis=1) * _POINT_STEP

"""Handmade networks of a few operators in ONNX files that can drive: for tests of everything around a network.

They follow the goal points at 6.5 m/s. `fusion` stops for everything that the view from above shows in the lane ahead.
`fusion_safe` reports it in the density map, as a standing box of its own for each square.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import onnx
from foresee_learned.inputs import BIRDS_EYE_SHAPE, CHANNELS, FORWARD_SHAPE, VECTOR
from foresee_learned.outputs import (
    DENSITY_CHANNELS,
    DENSITY_ROWS,
    FUSION_SAFE_TIMES_S,
    FUSION_TIMES_S,
    SPEED_BINS_MPS,
)
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

SPEED_MPS = 6.5
_PIXELS = 4
"""Pixels of the view from above along a square of the density map: 2 m by 0.5 m."""
_USERS = [CHANNELS.index(name) for name in ("vehicle", "two_wheeler", "pedestrian", "obstacle")]


def write_networks(folder: Path, *, speed_mps: float = SPEED_MPS, sums: bool = False) -> Path:
    """Write `fusion.onnx` and `fusion_safe.onnx` into a folder, and on request `SHA256SUMS`."""
    folder.mkdir(parents=True, exist_ok=True)
    files = {"fusion.onnx": fusion(speed_mps), "fusion_safe.onnx": fusion_safe(speed_mps)}
    for name, content in files.items():
        (folder / name).write_bytes(content)
    if sums:
        lines = [f"{hashlib.sha256(content).hexdigest()}  {name}\n" for name, content in files.items()]
        (folder / "SHA256SUMS").write_text("".join(lines))
    return folder


def fusion(speed_mps: float = SPEED_MPS) -> bytes:
    """Return a network that stops for every road user within 12 m ahead, and for a red stop line."""
    bins = np.zeros((2, len(SPEED_BINS_MPS)), np.float32)
    bins[0, SPEED_BINS_MPS.index(speed_mps)], bins[1, 0] = 1.0, 1.0
    stops = [*_USERS, CHANNELS.index("stop_red")]
    nodes = [
        *_waypoints(len(FUSION_TIMES_S)),
        helper.make_node("Gather", ["birds_eye", "stops"], ["seen"], axis=1),
        helper.make_node("Slice", ["seen", "first", "last", "axes"], ["near"]),
        helper.make_node("Cast", ["near"], ["near_f"], to=TensorProto.FLOAT),
        helper.make_node("ReduceMax", ["near_f"], ["most"], keepdims=0),
        helper.make_node("Div", ["most", "full"], ["blocked"]),
        helper.make_node("Mul", ["blocked", "stopped"], ["a"]),
        helper.make_node("Sub", ["one", "blocked"], ["open"]),
        helper.make_node("Mul", ["open", "driving"], ["b"]),
        helper.make_node("Add", ["a", "b"], ["target_speed"]),
    ]
    constants = {
        "points": _points(FUSION_TIMES_S, speed_mps),
        "shape": np.array([1, len(FUSION_TIMES_S), 2]),
        "stops": np.array(stops),
        "first": np.array([96 - 24 - 5, 60]),  # 12 m before the front
        "last": np.array([96 - 5, 68]),
        "axes": np.array([2, 3]),
        "full": np.array(255.0, np.float32),
        "one": np.array(1.0, np.float32),
        "driving": bins[:1],
        "stopped": bins[1:],
    }
    outputs = {"waypoints": (1, len(FUSION_TIMES_S), 2), "target_speed": (1, len(SPEED_BINS_MPS))}
    return _model(nodes, constants, outputs)


def fusion_safe(speed_mps: float = SPEED_MPS) -> bytes:
    """Return a network that reports each square with a road user, and a near red stop line."""
    zeros = np.zeros((1, len(DENSITY_CHANNELS) - 1, DENSITY_ROWS, DENSITY_ROWS), np.float32)
    for name, value in (("length_m", 2.0), ("width_m", 2.0), ("heading_cos", 1.0)):
        zeros[0, DENSITY_CHANNELS.index(name) - 1] = value
    red = CHANNELS.index("stop_red")
    nodes = [
        *_waypoints(len(FUSION_SAFE_TIMES_S)),
        helper.make_node("Gather", ["birds_eye", "users"], ["seen"], axis=1),
        helper.make_node("Slice", ["seen", "first", "last", "axes"], ["near"]),
        helper.make_node("Cast", ["near"], ["near_f"], to=TensorProto.FLOAT),
        helper.make_node("ReduceMax", ["near_f", "channel"], ["any"], keepdims=1),
        helper.make_node("MaxPool", ["any"], ["square"], kernel_shape=[_PIXELS] * 2, strides=[_PIXELS] * 2),
        helper.make_node("Div", ["square", "full"], ["occupied"]),
        helper.make_node("Concat", ["occupied", "rest"], ["density"], axis=1),
        helper.make_node("Slice", ["birds_eye", "red_first", "red_last", "red_axes"], ["red"]),
        helper.make_node("Cast", ["red"], ["red_f"], to=TensorProto.FLOAT),
        helper.make_node("ReduceMax", ["red_f"], ["red_most"], keepdims=0),
        helper.make_node("Div", ["red_most", "full"], ["red_p"]),
        helper.make_node("Mul", ["red_p", "ones_1"], ["stop_line"]),
        helper.make_node("Mul", ["red_p", "shows_red"], ["signal"]),
    ]
    constants = {
        "points": _points(FUSION_SAFE_TIMES_S, speed_mps),
        "shape": np.array([1, len(FUSION_SAFE_TIMES_S), 2]),
        "users": np.array(_USERS),
        "first": np.array([16, 16]),
        "last": np.array([112, 112]),
        "axes": np.array([2, 3]),
        "channel": np.array([1]),
        "full": np.array(255.0, np.float32),
        "rest": zeros,
        "red_first": np.array([red, 36, 56]),  # 30 m ahead
        "red_last": np.array([red + 1, 96, 72]),
        "red_axes": np.array([1, 2, 3]),
        "ones_1": np.ones((1, 1), np.float32),
        "shows_red": np.array([[1.0, 0.0, 0.0, 0.0]], np.float32),
    }
    outputs = {
        "waypoints": (1, len(FUSION_SAFE_TIMES_S), 2),
        "density": (1, len(DENSITY_CHANNELS), DENSITY_ROWS, DENSITY_ROWS),
        "stop_line": (1, 1),
        "signal": (1, 4),
    }
    return _model(nodes, constants, outputs)


def _waypoints(count: int) -> list[onnx.NodeProto]:
    del count  # `shape` has it
    return [
        helper.make_node("MatMul", ["vector", "points"], ["flat"]),
        helper.make_node("Reshape", ["flat", "shape"], ["waypoints"]),
    ]


def _points(times_s: tuple[float, ...], speed_mps: float) -> NDArray[np.float32]:
    """Return the matrix from the vector to waypoints: along the chords to the goal points 8 m and 24 m ahead."""
    near, far = VECTOR.index("goal_8_m_ahead_m"), VECTOR.index("goal_24_m_ahead_m")
    matrix = np.zeros((len(VECTOR), len(times_s), 2), np.float32)
    for k, time_s in enumerate(times_s):
        way = time_s * speed_mps
        share = max(way - 8.0, 0.0) / 16.0
        for axis in (0, 1):
            matrix[near + axis, k, axis] = min(way / 8.0, 1.0) - share
            matrix[far + axis, k, axis] = share
    return matrix.reshape(len(VECTOR), -1)


def _model(
    nodes: list[onnx.NodeProto], constants: dict[str, NDArray[np.generic]], outputs: dict[str, tuple[int, ...]]
) -> bytes:
    inputs = [
        helper.make_tensor_value_info("birds_eye", TensorProto.UINT8, (1, *BIRDS_EYE_SHAPE)),
        helper.make_tensor_value_info("forward", TensorProto.UINT8, (1, *FORWARD_SHAPE)),
        helper.make_tensor_value_info("vector", TensorProto.FLOAT, (1, len(VECTOR))),
    ]
    value_infos = [helper.make_tensor_value_info(name, TensorProto.FLOAT, shape) for name, shape in outputs.items()]
    kept = [numpy_helper.from_array(np.ascontiguousarray(value), name) for name, value in constants.items()]
    graph = helper.make_graph(nodes, "by_hand", inputs, value_infos, kept)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=9)
    onnx.checker.check_model(model)
    return bytes(model.SerializeToString())

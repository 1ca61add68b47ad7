"""Writes a trained autoencoder as an ONNX file: input `pictures` (uint8 [N, 80, 160, 3]), output `errors` (float32
[N])."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper
from torch import nn

from training.selforacle.autoencoders import COLOURS, COLUMNS, PIXELS, ROWS, Autoencoder
from training.selforacle.shrink import LARGE, long_axis

OPSET = 17
_SMALL = 4096
"""Arrays of fewer values are stored as float32."""


def write_onnx(network: Autoencoder, file: Path) -> None:
    """Write a network that `shrink.rounded` rounded; its weights become float32 again when the file is loaded."""
    graph = _Graph()
    scaled = graph.add("Div", graph.add("Cast", "pictures", to=TensorProto.FLOAT), graph.array(np.float32(255)))
    picture = graph.add("Transpose", scaled, perm=[0, 3, 1, 2])
    hidden = graph.layers(network.encoder, picture)
    redrawn = graph.layers(network.decoder, graph.layer(network.mean, hidden))
    wrong = graph.add("Sub", redrawn, picture)
    squares = graph.add("Reshape", graph.add("Mul", wrong, wrong), graph.array(np.array([-1, PIXELS])))
    graph.add("ReduceMean", squares, outputs=["errors"], axes=[1], keepdims=0)
    inputs = [helper.make_tensor_value_info("pictures", TensorProto.UINT8, ["N", ROWS, COLUMNS, COLOURS])]
    outputs = [helper.make_tensor_value_info("errors", TensorProto.FLOAT, ["N"])]
    model = helper.make_model(
        helper.make_graph(graph.nodes, "selforacle", inputs, outputs, graph.arrays),
        opset_imports=[helper.make_opsetid("", OPSET)], ir_version=9,
    )  # fmt: skip
    onnx.checker.check_model(model)
    file.write_bytes(model.SerializeToString())


class _Graph:
    """Nodes and arrays of a graph under construction."""

    def __init__(self) -> None:
        self.nodes: list[Any] = []
        self.arrays: list[Any] = []

    def add(self, kind: str, *inputs: str, outputs: list[str] | None = None, **attributes: Any) -> str:  # noqa: ANN401
        """Add a node; return the name of its output."""
        outputs = outputs or [f"v{len(self.nodes)}"]
        self.nodes.append(helper.make_node(kind, list(inputs), outputs, **attributes))
        return outputs[0]

    def array(self, values: NDArray[Any] | np.generic) -> str:
        """Add an array to the graph; return the name of its value as float32, or as integers if it has integers."""
        name, values = f"a{len(self.arrays)}", np.asarray(values)
        if values.size > LARGE and values.ndim == 2:
            scale = np.abs(values).max(long_axis(values.shape), keepdims=True) / 127
            self.arrays.append(numpy_helper.from_array(np.rint(values / scale).astype(np.int8), name))
            return self.add("Mul", self.add("Cast", name, to=TensorProto.FLOAT), self.array(scale.astype(np.float32)))
        half = values.dtype == np.float32 and values.size >= _SMALL
        self.arrays.append(numpy_helper.from_array(values.astype(np.float16) if half else values, name))
        return self.add("Cast", name, to=TensorProto.FLOAT) if half else name

    def layers(self, several: nn.Sequential, value: str) -> str:
        """Add layers, one after the other."""
        for module in several:
            value = self.layer(module, value)
        return value

    def layer(self, module: nn.Module, value: str) -> str:
        """Add a layer."""
        match module:
            case nn.Linear():
                weight = self.array(module.weight.detach().cpu().numpy().T.copy())
                return self.add("Gemm", value, weight, self.array(module.bias.detach().cpu().numpy()))
            case nn.Conv2d() | nn.ConvTranspose2d():
                kind = "Conv" if isinstance(module, nn.Conv2d) else "ConvTranspose"
                weight, bias = (self.array(a.detach().cpu().numpy()) for a in (module.weight, module.bias))
                return self.add(
                    kind, value, weight, bias, strides=list(module.stride), pads=[*module.padding, *module.padding]
                )
            case nn.ReLU():
                return self.add("Relu", value)
            case nn.Sigmoid():
                return self.add("Sigmoid", value)
            case nn.Flatten():
                return self.add("Flatten", value)
            case nn.Unflatten():
                return self.add("Reshape", value, self.array(np.array([-1, *module.unflattened_size])))
            case _:
                raise TypeError(f"no such layer in a file: {module}")

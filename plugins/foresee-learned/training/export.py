"""Writes trained networks as ONNX files for onnxruntime: `python -m training.export fusion CHECKPOINT fusion.onnx`."""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
import torch
from foresee_learned.outputs import FUSION_OUTPUTS, FUSION_SAFE_OUTPUTS, INPUTS
from onnx import TensorProto, helper, numpy_helper
from torch import nn

from training.dataset import Data
from training.models.blocks import examples
from training.models.fusion import Fusion, FusionDriver
from training.models.fusion_safe import FusionSafe, FusionSafeDriver

NETWORKS: dict[str, tuple[type[nn.Module], type[nn.Module], tuple[str, ...]]] = {
    "fusion": (Fusion, FusionDriver, FUSION_OUTPUTS),
    "fusion_safe": (FusionSafe, FusionSafeDriver, FUSION_SAFE_OUTPUTS),
}
"""Of each driver: the network for training, the network for driving, and the names of its outputs."""
_LEAST_HALF = 256
"""Weights with fewer numbers stay float32."""
_SMALL = 1e-3
"""Weights whose mean magnitude is below this stay float32 too: they multiply whole bytes. Below 6e-5, float16 loses
digits."""
_BLOCK = 16
"""Number of channels that onnxruntime processes together on processors with AVX-512."""


def export(name: str, trained: nn.Module, path: Path) -> None:
    """Write a network; weights are stored as float16 and cast when it is loaded."""
    _, driver, outputs = NETWORKS[name]
    path.parent.mkdir(parents=True, exist_ok=True)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        torch.onnx.export(
            driver(trained).eval(), examples(), str(path), input_names=list(INPUTS), output_names=list(outputs),
            opset_version=17, dynamo=False, do_constant_folding=True,
        )  # fmt: skip
    model = halved(first_in_parts(simplified(path)))
    model.producer_name, model.producer_version = "foresee-dsl training", ""
    onnx.checker.check_model(model)
    onnx.save(model, path)


def simplified(path: Path) -> onnx.ModelProto:
    """Return a file's network as onnxruntime simplifies it for any machine: constants folded, normalisations in the
    convolutions before them."""
    options = onnxruntime.SessionOptions()
    options.graph_optimization_level = onnxruntime.GraphOptimizationLevel.ORT_ENABLE_BASIC
    options.intra_op_num_threads, options.log_severity_level = 1, 3
    options.optimized_model_filepath = str(path)
    onnxruntime.InferenceSession(path.read_bytes(), options, providers=["CPUExecutionProvider"])
    return onnx.load(path)


def first_in_parts(model: onnx.ModelProto) -> onnx.ModelProto:
    """Split each first convolution over 16 to 32 channels into two with half of the channels each, and add their
    outputs.

    onnxruntime works in blocks of 16 channels, so that 20 cost as much as 32; below 16 it processes exactly that
    number.
    """
    graph = model.graph
    weights = {weight.name: weight for weight in graph.initializer}
    casts = {node.output[0]: node for node in graph.node if node.op_type == "Cast" and node.input[0] in INPUTS}
    nodes: list[onnx.NodeProto] = []
    for node in graph.node:
        cast = casts.get(node.input[0]) if node.op_type == "Conv" else None
        channels = weights[node.input[1]].dims[1] if cast is not None else 0
        if cast is None or not _BLOCK < channels <= 2 * _BLOCK:
            nodes.append(node)
            continue
        source, half = cast.input[0], channels // 2
        kernel = numpy_helper.to_array(weights[node.input[1]])
        parts = {f"{source}_{k}": part for k, part in enumerate((kernel[:, :half], kernel[:, half:]))}
        sizes = numpy_helper.from_array(np.array([part.shape[1] for part in parts.values()]), f"{source}_sizes")
        graph.initializer.append(sizes)
        nodes.append(helper.make_node("Split", [source, sizes.name], list(parts), axis=1))
        for name, part in parts.items():
            graph.initializer.append(numpy_helper.from_array(np.ascontiguousarray(part), f"{name}_kernel"))
            nodes.append(helper.make_node("Cast", [name], [f"{name}_float"], to=TensorProto.FLOAT))
            bias = [node.input[2]] if name.endswith("_0") else []
            convolution = helper.make_node("Conv", [f"{name}_float", f"{name}_kernel", *bias], [f"{name}_seen"])
            convolution.attribute.extend(node.attribute)
            nodes.append(convolution)
        nodes.append(helper.make_node("Add", [f"{name}_seen" for name in parts], list(node.output)))
    used = {name for node in nodes for name in node.input}
    kept = [node for node in nodes if used.intersection(node.output) or _answers(graph, node)]
    weights_used = [weight for weight in graph.initializer if weight.name in used]
    del graph.node[:], graph.initializer[:]
    graph.node.extend(kept)
    graph.initializer.extend(weights_used)
    return model


def _answers(graph: onnx.GraphProto, node: onnx.NodeProto) -> bool:
    return any(output.name in node.output for output in graph.output)


def halved(model: onnx.ModelProto) -> onnx.ModelProto:
    """Store weights as float16 with a cast behind each; onnxruntime folds the casts when it loads the file."""
    graph = model.graph
    casts = []
    for weight in graph.initializer:
        if weight.data_type != TensorProto.FLOAT or np.prod(weight.dims) < _LEAST_HALF:
            continue
        full = numpy_helper.to_array(weight)
        if np.abs(full).mean() >= _SMALL:
            name = weight.name
            weight.CopyFrom(numpy_helper.from_array(full.astype(np.float16), name + "_half"))
            casts.append(helper.make_node("Cast", [name + "_half"], [name], to=TensorProto.FLOAT))
    nodes = [*casts, *graph.node]
    del graph.node[:]
    graph.node.extend(nodes)
    return model


def session(path: Path) -> onnxruntime.InferenceSession:
    """Open a network as the drivers do: on one thread."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    return onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])


def furthest(name: str, trained: nn.Module, path: Path, inputs: Sequence[tuple[torch.Tensor, ...]]) -> dict[str, float]:
    """Return for each output the largest difference between the file's answer and torch's."""
    _, driver, outputs = NETWORKS[name]
    model, opened = driver(trained).eval(), session(path)
    apart = dict.fromkeys(outputs, 0.0)
    for batch in inputs:
        with torch.inference_mode():
            wanted = model(*batch)
        answers = opened.run(None, {key: value.numpy() for key, value in zip(INPUTS, batch, strict=True)})
        for output, a, b in zip(outputs, wanted, answers, strict=True):
            apart[output] = max(apart[output], float(np.abs(a.numpy() - b).max()))
    return apart


def main() -> None:
    """Export a checkpoint, and compare the file with it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("name", choices=sorted(NETWORKS))
    parser.add_argument("checkpoint", type=Path, help="what training.train wrote; 'random' for weights by chance")
    parser.add_argument("out", type=Path)
    parser.add_argument("--data", type=Path, nargs="*", help="drawn samples (training.dataset) to compare answers on")
    options = parser.parse_args()
    torch.manual_seed(0)
    trained = NETWORKS[options.name][0]()
    if options.checkpoint.name != "random":
        trained.load_state_dict(torch.load(options.checkpoint, map_location="cpu", weights_only=True)["ema"])
    trained.eval()
    export(options.name, trained, options.out)
    inputs = [examples() for _ in range(4)]
    if options.data:
        data = Data(options.data, torch.device("cpu"))
        some = torch.arange(0, len(data.columns["run"]), max(1, len(data.columns["run"]) // 200))
        batches = [data.batch(index) for index in some[:, None]]
        inputs = [tuple(batch[name] for name in INPUTS) for batch in batches]
    apart = furthest(options.name, trained, options.out, inputs)
    size, parameters = options.out.stat().st_size, sum(p.numel() for p in trained.parameters())
    print(f"{options.out}: {size:,} bytes, {parameters:,} parameters; torch in float32 differs by at most {apart}")  # noqa: T201


if __name__ == "__main__":
    main()

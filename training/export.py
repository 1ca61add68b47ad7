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
from onnx import TensorProto, helper, numpy_helper
from torch import nn

from foresee_dsl.drivers.learned.outputs import FUSION_OUTPUTS, FUSION_SAFE_OUTPUTS, INPUTS
from training.dataset import Data
from training.models.blocks import examples
from training.models.fusion import Fusion, FusionDriver
from training.models.fusion_safe import FusionSafe, FusionSafeDriver

NETWORKS: dict[str, tuple[type[nn.Module], type[nn.Module], tuple[str, ...]]] = {
    "fusion": (Fusion, FusionDriver, FUSION_OUTPUTS),
    "fusion_safe": (FusionSafe, FusionSafeDriver, FUSION_SAFE_OUTPUTS),
}
"""What is trained, what drives, and the names of its outputs."""
_LEAST_HALF = 256
"""Weights with fewer numbers stay float32, and so do"""
_SMALL = 1e-3
"""weights whose mean magnitude is under this: those that take in whole bytes. Under 6e-5 float16 loses digits."""


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
    model = halved(onnx.load(path))
    model.producer_name, model.producer_version = "foresee-dsl training", ""
    onnx.checker.check_model(model)
    onnx.save(model, path)


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
    """Return for each output how far the file's answer is from torch's at most."""
    _, driver, outputs = NETWORKS[name]
    model, opened = driver(trained).eval(), session(path)
    apart = dict.fromkeys(outputs, 0.0)
    for one in inputs:
        with torch.inference_mode():
            wanted = model(*one)
        given = opened.run(None, {key: value.numpy() for key, value in zip(INPUTS, one, strict=True)})
        for output, a, b in zip(outputs, wanted, given, strict=True):
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

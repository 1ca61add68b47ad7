"""The trained autoencoder for one driver: its weights, and the threshold of its errors on nominal driving.

Each driver has its own, because what is nominal depends on the driver: `selforacle_pdm.onnx` (or `selforacle_conv_pdm`)
with `selforacle_pdm.json` beside it. They come with the package; the environment variable `FORESEE_WEIGHTS` names a
folder that is searched first.
"""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import dataclass
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from foresee_learned.weights import FOLDER_VARIABLE, Weights, checked
from numpy.typing import NDArray

from foresee_dsl.errors import ForeseeError
from foresee_dsl.kernels.arrays import FloatArray

if TYPE_CHECKING:
    from foresee_learned.session import Network

BUNDLED = Path(__file__).resolve().parent / "weights"
_BATCH = 16
"""Number of pictures in one call of the network. Ours: a run has about 60; larger batches are not faster on one
thread."""


@dataclass(frozen=True)
class Watcher:
    """An autoencoder together with its threshold.

    Attributes:
        weights: its ONNX file.
        threshold: the error of a segment below which 95 % of nominal segments stay.
        sha256: hash of the weights and of the threshold's file.
    """

    weights: Weights
    threshold: float
    sha256: str

    def errors(self, pictures: NDArray[np.uint8]) -> FloatArray:
        """Return the reconstruction error of each picture [N, 80, 160, 3]: the mean squared error of values from 0 to
        1.
        """
        network = _network(self.weights)
        batches = (pictures[k : k + _BATCH] for k in range(0, len(pictures), _BATCH))
        errors = [network.answers({"pictures": batch})["errors"] for batch in batches]
        return np.concatenate(errors).astype(np.float64) if errors else np.empty(0)


def watcher_of(ranker: str, driver: str) -> Watcher:
    """Return the autoencoder for a driver, which is named by its address (`pdm`, `external:python3 mine.py`).

    Raises:
        ForeseeError: none was trained for the driver, its files are damaged, or onnxruntime is not installed.
    """
    if find_spec("onnxruntime") is None:
        raise ForeseeError(f'the ranker {ranker} needs onnxruntime: `pip install "foresee-dsl[learned]"`')
    driver = driver.partition(":")[0]
    name = f"{ranker}_{driver}"
    own = os.environ.get(FOLDER_VARIABLE)
    for folder in (Path(own), BUNDLED) if own else (BUNDLED,):
        file = folder / f"{name}.onnx"
        if file.is_file():
            weights = checked(file, sums_needed=folder == BUNDLED)
            about = file.with_suffix(".json").read_bytes()
            both = hashlib.sha256(weights.sha256.encode() + hashlib.sha256(about).hexdigest().encode()).hexdigest()
            return Watcher(weights, float(json.loads(about)["threshold"]), both)
    raise ForeseeError(
        f"the ranker {ranker} has no weights for the driver {driver!r} (it has weights for "
        f"{', '.join(_watched(ranker)) or 'no driver'}): train them in a checkout with "
        f"`python -m training.selforacle.rides --driver {driver}`, `training.selforacle.train` and "
        f"`training.selforacle.thresholds` (docs/background/selforacle.md), then set {FOLDER_VARIABLE} to their folder"
    )


def _watched(ranker: str) -> list[str]:
    """Return the drivers for which there are weights."""
    names = (file.stem.removeprefix("selforacle_") for file in sorted(BUNDLED.glob("selforacle_*.onnx")))
    convolutional = ranker.endswith("_conv")
    return [name.removeprefix("conv_") for name in names if name.startswith("conv_") == convolutional]


@lru_cache(maxsize=4)
def _network(weights: Weights) -> Network:
    from foresee_learned.session import network_of  # imported here, because it is needed only when a run is ranked

    return network_of(weights)

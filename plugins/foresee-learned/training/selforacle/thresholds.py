"""Computes a threshold from the errors on nominal driving: the quantile of a gamma distribution, as in the original.

    python -m training.selforacle.thresholds --driver pdm --folder FOLDER

It reads the files of `training.selforacle.train` in the folder, and writes `selforacle_DRIVER.json` and
`selforacle_conv_DRIVER.json` beside the networks. False alarms are counted on rides without training.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import gamma

QUANTILE = 0.95
"""The paper's, section 4.3.1: one segment in twenty is a false alarm on nominal driving."""
HELD_OUT = 10
"""Rides whose seed is a multiple of this were not trained on."""
NETWORKS = {"selforacle": "thin", "selforacle_conv": "conv"}
"""Names of each network's errors in the training's file, by ranker."""


def segment_errors(
    errors: NDArray[np.float32], ride: NDArray[np.int32], segment: NDArray[np.int32]
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Return the mean error of each segment of each ride, and its ride."""
    changes = np.flatnonzero((np.diff(ride) != 0) | (np.diff(segment) != 0)) + 1
    starts = np.concatenate(([0], changes))
    counts = np.diff(np.concatenate((starts, [len(ride)])))
    return np.add.reduceat(errors.astype(np.float64), starts) / counts, ride[starts]


def fitted(errors: NDArray[np.float64]) -> tuple[float, float, float]:
    """Fit a gamma distribution that begins at 0; return its shape, its scale, and its 0.95 quantile."""
    shape, _, scale = gamma.fit(errors, floc=0)
    return float(shape), float(scale), float(gamma.ppf(QUANTILE, shape, scale=scale))


def facts_of(network: str, training: Any) -> dict[str, Any]:  # noqa: ANN401 - an opened .npz
    """Return the content of a network's JSON file."""
    means, rides = segment_errors(training[NETWORKS[network]], training["ride"], training["segment"])
    fresh = rides % HELD_OUT == 0
    shape, scale, threshold = fitted(means[~fresh])
    about = json.loads(training["about"].tobytes())
    name = "conv" if network.endswith("conv") else "dense"
    return {
        "threshold": threshold,
        "quantile": QUANTILE,
        "gamma": {"shape": shape, "scale": scale},
        "segments": {"trained_on": int((~fresh).sum()), "fresh": int(fresh.sum())},
        "alarms": {
            "trained_on": float((means[~fresh] > threshold).mean()),
            "fresh": float((means[fresh] > threshold).mean()),
        },
        "training": {
            **{key: about[key] for key in ("pictures", "trained_on", "epochs", "batch", "seed")},
            "rides": len(np.unique(training["ride"])),
            "loss": about[f"{name}_loss"],
        },
    }


def main() -> None:
    """Write the JSON files."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--driver", default="pdm")
    parser.add_argument("--folder", type=Path, required=True)
    options = parser.parse_args()
    with np.load(options.folder / f"training_{options.driver}.npz") as training:
        for network, name in NETWORKS.items():
            if name in training:
                facts = facts_of(network, training)
                file = options.folder / f"{network}_{options.driver}.json"
                file.write_text(json.dumps(facts, indent=1) + "\n", encoding="utf-8")
                false = facts["alarms"]["fresh"]
                print(f"{file}: threshold {facts['threshold']:.6f}, {false:.1%} alarms on fresh rides")  # noqa: T201


if __name__ == "__main__":
    main()

"""Train SelfOracle's autoencoders on rides, on a GPU where there is one.

    python -m training.selforacle.train --rides FOLDER --driver pdm --out FOLDER

It writes `selforacle_DRIVER.onnx` (the original's network with thin layers), `selforacle_conv_DRIVER.onnx`, and
`training_DRIVER.npz`: the loss of each epoch, the error of each picture, and how far the thin layers stray.
Needs torch, onnx and numpy, nothing of SUMO.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from training.selforacle.autoencoders import NETWORKS, ROWS, Autoencoder
from training.selforacle.export import write_onnx
from training.selforacle.packing import load
from training.selforacle.shrink import polished, rounded, shrunk

EPOCHS, LEARNING_RATE = 10, 0.001
"""The paper's values, section 4.3.1, with Adam."""
BATCH = 32
"""The default of the original's code."""
SEED = 14
HELD_OUT = 10
"""Rides whose seed is a multiple of this are not trained on; alarms on them are false alarms on fresh driving."""
TRIED_RANKS = ((64, 32), (128, 64))
POLISHING_RATES, POLISHING_BATCH = (3e-4, 1e-4, 3e-5), 64
"""Adam's learning rates, one after the other, each for all pictures once. Ours."""
RANKS = (64, 32)
"""Widths of the encoder's and the decoder's thin layers. Ours: docs/background/selforacle.md says how they stray."""


class Pictures:
    """Pictures as classes of pixels on the device; colours are computed on request."""

    def __init__(self, classes: NDArray[np.uint8], palette: NDArray[np.uint8], device: str) -> None:
        self._classes = torch.from_numpy(classes).to(device)
        self._palette = torch.from_numpy(palette).to(device).float() / 255
        self._rows = torch.arange(ROWS, device=device) * classes.shape[1] // ROWS

    def __len__(self) -> int:
        return len(self._classes)

    def at(self, which: Tensor) -> Tensor:
        """Return pictures [N, 3, 80, 160] from 0 to 1."""
        seen = self._classes[which][:, self._rows].long()
        return self._palette[seen].permute(0, 3, 1, 2).contiguous()

    def some(self) -> Iterator[Tensor]:
        """Yield about 20,000 pictures in batches, spread over all."""
        return self.batches(every=max(len(self) // 20_000, 1))

    def batches(self, size: int = 512, every: int = 1) -> Iterator[Tensor]:
        """Yield every `every`-th picture (by default all) in batches."""
        for which in torch.arange(0, len(self), every, device=self._classes.device).split(size):
            yield self.at(which)


def train(network: Autoencoder, pictures: Pictures, trained_on: Tensor, *, epochs: int, batch: int) -> list[float]:
    """Train a network; return the mean loss of each epoch."""
    optimiser = torch.optim.Adam(network.parameters(), LEARNING_RATE)
    losses = []
    for epoch in range(epochs):
        network.train()
        total = torch.zeros((), device=trained_on.device)
        order = trained_on[torch.randperm(len(trained_on), device=trained_on.device)]
        for which in order[: len(order) // batch * batch].split(batch):
            loss = network.errors(pictures.at(which)).mean()
            optimiser.zero_grad(set_to_none=True)
            loss.backward()
            optimiser.step()
            total += loss.detach()
        losses.append(float(total) / (len(order) // batch))
        print(f"epoch {epoch + 1}: loss {losses[-1]:.6f}, {time.perf_counter():.0f} s", flush=True)  # noqa: T201
    network.eval()
    return losses


@torch.no_grad()
def errors_of(network: Autoencoder, pictures: Pictures) -> NDArray[np.float32]:
    """Return the error of every picture."""
    return torch.cat([network.errors(batch) for batch in pictures.batches()]).cpu().numpy()


def _thin(
    network: Autoencoder, pictures: Pictures, trained_on: Tensor, ranks: tuple[int, int], about: dict[str, object],
    errors: NDArray[np.float32],
) -> tuple[NDArray[np.float32], Autoencoder]:  # fmt: skip
    """Return the network with thin layers, and its errors; record their largest difference from the large network's."""

    def stray(name: str, small: Autoencoder) -> NDArray[np.float32]:
        strayed = errors_of(small, pictures)
        off = np.abs(strayed / errors - 1)
        about[f"strays_{name}"] = {
            "mean": float(off.mean()),
            "0.99": float(np.quantile(off, 0.99)),
            "most": float(off.max()),
        }
        return strayed

    for rank in TRIED_RANKS:
        stray(f"{rank[0]}_{rank[1]}", rounded(shrunk(network, pictures.some, *rank)))
    small = shrunk(network, pictures.some, *ranks)
    for rate in POLISHING_RATES:
        order = trained_on[torch.randperm(len(trained_on), device=trained_on.device)]
        polished(small, network, (pictures.at(which) for which in order.split(POLISHING_BATCH)), rate)
        stray(f"{ranks[0]}_{ranks[1]}_polished_{rate:g}", small)
    return stray("stored", rounded(small)), small


def main() -> None:
    """Train both networks."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rides", type=Path, required=True, help="folder with what training.selforacle.rides wrote")
    parser.add_argument("--driver", default="pdm")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--epochs", type=int, default=EPOCHS)
    parser.add_argument("--batch", type=int, default=BATCH)
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--networks", nargs="+", default=list(NETWORKS), choices=list(NETWORKS))
    parser.add_argument("--ranks", type=int, nargs=2, default=RANKS)
    options = parser.parse_args()
    device = "cuda" if torch.cuda.is_available() else "cpu"
    rides = load(sorted(options.rides.glob(f"{options.driver}_*.npz")))
    pictures = Pictures(rides.classes, rides.palette, device)
    trained_on = torch.from_numpy(np.flatnonzero(rides.ride % HELD_OUT != 0)).to(device)
    print(f"{len(rides)} pictures, {len(trained_on)} to train on, on {device}", flush=True)  # noqa: T201
    options.out.mkdir(parents=True, exist_ok=True)
    arrays: dict[str, NDArray[np.generic]] = {"ride": rides.ride, "segment": rides.segment}
    about: dict[str, object] = {"pictures": len(rides), "trained_on": len(trained_on), "epochs": options.epochs,
                                "batch": options.batch, "seed": options.seed}  # fmt: skip
    for name in options.networks:
        torch.manual_seed(options.seed)
        network = NETWORKS[name]().to(device)
        about[f"{name}_weights"] = sum(p.numel() for p in network.parameters())
        about[f"{name}_loss"] = train(network, pictures, trained_on, epochs=options.epochs, batch=options.batch)
        arrays[name] = errors_of(network, pictures)
        if name == "dense":
            arrays["thin"], small = _thin(network, pictures, trained_on, tuple(options.ranks), about, arrays["dense"])
            write_onnx(small, options.out / f"selforacle_{options.driver}.onnx")
        else:
            arrays[name] = errors_of(rounded(network), pictures)
            write_onnx(network, options.out / f"selforacle_conv_{options.driver}.onnx")
    print(json.dumps(about, indent=1))  # noqa: T201
    arrays["about"] = np.frombuffer(json.dumps(about).encode(), np.uint8)
    np.savez_compressed(options.out / f"training_{options.driver}.npz", **arrays)


if __name__ == "__main__":
    main()

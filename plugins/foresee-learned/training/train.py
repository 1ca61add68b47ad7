"""Trains a driver's network on drawn samples: `python -m training.train fusion --data DRAWN --out FOLDER`.

Writes FOLDER/NAME_seedS.pt (the averaged weights), NAME_seedS.csv (loss curves) and NAME_seedS.json (settings, how many
samples, the measures on cases held out).
"""

from __future__ import annotations

import argparse
import copy
import csv
import json
import math
import time
from pathlib import Path

import torch
from foresee_learned.outputs import FUSION_SAFE_TIMES_S, FUSION_TIMES_S, SPEED_BINS_MPS, TARGET_SPEED_S
from torch import Tensor, nn

from training.dataset import Data
from training.losses import density_maps, losses, places_at, speed_at
from training.models.blocks import UNKNOWN_SPEED_MPS
from training.models.fusion import Fusion, FusionAnswer
from training.models.fusion_safe import FusionSafe

NETWORKS: dict[str, type[nn.Module]] = {"fusion": Fusion, "fusion_safe": FusionSafe}
_HIDDEN_SPEED = 0.1
"""Share of samples with hidden speed: a driver that always knows its speed learns to keep it."""
_HIDDEN_PAST = 0.1
_SPEED_NOISE_MPS, _GOAL_NOISE_M = 0.15, 0.05
_WARM_UP = 0.05
"""Share of the training in which the learning rate rises."""
_AVERAGE = 0.999


class Average:
    """An exponential moving average of a network's weights."""

    def __init__(self, network: nn.Module) -> None:
        self.network = copy.deepcopy(network).eval().requires_grad_(False)
        self._steps = 0

    @torch.no_grad()
    def take(self, network: nn.Module) -> None:
        """Average the weights after a step; other values are copied."""
        self._steps += 1
        keep = min(_AVERAGE, (1 + self._steps) / (10 + self._steps))
        mine, new = self.network.state_dict(), network.state_dict()
        floats = [name for name, value in mine.items() if value.is_floating_point()]
        torch._foreach_lerp_([mine[name] for name in floats], [new[name] for name in floats], 1 - keep)


def altered(batch: dict[str, Tensor], generator: torch.Generator) -> dict[str, Tensor]:
    """Return a minibatch with hidden speeds, hidden pasts and noise, as far as the labels stay valid."""
    vector, above = batch["vector"].clone(), batch["birds_eye"]
    count, device = len(vector), vector.device
    chance = torch.rand(2, count, generator=generator, device=device)
    noise = torch.randn(count, 5, generator=generator, device=device)
    moving = (vector[:, 0] > 0.5).float()
    vector[:, 0] = torch.where(
        chance[0] < _HIDDEN_SPEED, UNKNOWN_SPEED_MPS, vector[:, 0] + _SPEED_NOISE_MPS * moving * noise[:, 0]
    )
    vector[:, 2:6] += _GOAL_NOISE_M * noise[:, 1:]
    hidden = (chance[1] < _HIDDEN_PAST)[:, None, None, None]
    above[:, -2:] = torch.where(hidden, 0, above[:, -2:])
    return {**batch, "vector": vector, "birds_eye": above}


@torch.no_grad()
def measures(network: nn.Module, data: Data, most: int = 16384) -> dict[str, float]:
    """Return the quality of the answers on held-out cases."""
    index = data.validation
    if not len(index):
        return {}
    index = index[torch.linspace(0, len(index) - 1, min(most, len(index)), device=index.device).long()]
    sums: dict[str, Tensor] = {}
    counts: dict[str, Tensor] = {}

    def add(name: str, values: Tensor, chosen: Tensor | None = None) -> None:
        kept = values.float() if chosen is None else values.float()[chosen]
        sums[name] = sums.get(name, torch.zeros((), device=kept.device)) + kept.sum()
        counts[name] = counts.get(name, torch.zeros((), device=kept.device)) + kept.numel()

    for part in index.split(1024):
        batch = data.batch(part)
        answer = network(batch["birds_eye"], batch["forward"], batch["vector"])
        times = FUSION_TIMES_S if isinstance(answer, FusionAnswer) else FUSION_SAFE_TIMES_S
        wanted = places_at(batch["trajectory"], times)
        off = (answer.waypoints - wanted).norm(dim=2)
        speed, aim = batch["vector"][:, 0], speed_at(batch["trajectory"], TARGET_SPEED_S)
        brakes, starts = aim < speed - 1, (speed < 1.5) & (aim > speed + 1)
        add("waypoints_m", off.mean(1))
        add("last_waypoint_m", off[:, -1])
        add("first_seconds_left_m", (answer.waypoints - wanted)[:, :4, 1].abs().mean(1))
        for name, chosen in (("braking", brakes), ("starting", starts)):
            add(f"waypoints_m_{name}", off.mean(1), chosen)
        if isinstance(answer, FusionAnswer):
            bins = torch.tensor(SPEED_BINS_MPS, device=speed.device)
            error = (torch.softmax(answer.target_speed.float(), 1) @ bins - aim).abs()
            add("target_speed_mps", error)
            add("target_speed_mps_braking", error, brakes)
            add("target_speed_mps_starting", error, starts)
        occupied, _ = density_maps(batch)
        predicted = answer.density[:, 0] > 0
        add("density_recall", predicted, occupied > 0)
        add("density_precision", occupied, predicted)
        add("stop_line_right", (answer.stop_line[:, 0] > 0) == (batch["stop_line"] > 0.5))
        add("signal_right", answer.signal.argmax(1) == batch["signal"])
    return {name: float(total / counts[name].clamp(min=1)) for name, total in sums.items()}


def main() -> None:
    """Train one network."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("name", choices=sorted(NETWORKS))
    parser.add_argument("--data", type=Path, nargs="+", required=True, help="folders that training.dataset wrote")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--steps", type=int, default=10_000)
    parser.add_argument("--minutes", type=float, default=60.0, help="limit; the learning rate then falls sooner")
    parser.add_argument("--batch", type=int, default=1024)
    parser.add_argument("--rate", type=float, default=1e-3)
    parser.add_argument("--from", dest="begin", type=Path, help="weights to begin with")
    parser.add_argument("--device", default="cuda" if torch.cuda.is_available() else "cpu")
    options = parser.parse_args()
    train(options)


def train(options: argparse.Namespace) -> None:
    """Train one network as the command line says."""
    began = time.monotonic()
    torch.manual_seed(options.seed)
    device = torch.device(options.device)
    torch.backends.cuda.matmul.allow_tf32 = torch.backends.cudnn.allow_tf32 = True
    torch.backends.cudnn.benchmark = True
    generator = torch.Generator(device).manual_seed(options.seed)
    data = Data(options.data, device)
    network = NETWORKS[options.name]().to(device)
    if options.begin:
        network.load_state_dict(torch.load(options.begin, map_location=device, weights_only=True)["ema"])
    network = network.to(memory_format=torch.channels_last)
    decayed = [p for p in network.parameters() if p.ndim > 1]
    others = [p for p in network.parameters() if p.ndim <= 1]
    groups = [{"params": decayed, "weight_decay": 0.02}, {"params": others, "weight_decay": 0.0}]
    optimizer = torch.optim.AdamW(groups, lr=options.rate, betas=(0.9, 0.98), fused=device.type == "cuda")
    average = Average(network)
    stem = f"{options.name}_seed{options.seed}"
    options.out.mkdir(parents=True, exist_ok=True)
    loaded_s = time.monotonic() - began
    _say(f"{stem}: {len(data.training)} samples, {len(data.validation)} held out, {loaded_s:.0f} s to load")
    rows: list[dict[str, float]] = []
    kept: dict[str, Tensor] = {}
    step, progress = 0, 0.0
    while progress < 1:
        rate = (
            options.rate * min(1.0, progress / _WARM_UP + 1e-3) * (0.01 + 0.99 * (1 + math.cos(math.pi * progress)) / 2)
        )
        for group in optimizer.param_groups:
            group["lr"] = rate
        batch = altered(data.batch(data.chosen(options.batch, generator)), generator)
        with torch.autocast(device.type, torch.bfloat16):
            answer = network(batch["birds_eye"], batch["forward"], batch["vector"])
        parts = losses(answer, batch)
        optimizer.zero_grad(set_to_none=True)
        torch.stack(list(parts.values())).sum().backward()
        nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimizer.step()
        average.take(network)
        step += 1
        progress = max(step / options.steps, (time.monotonic() - began) / (60 * options.minutes))
        for name, value in parts.items():
            kept[name] = kept.get(name, torch.zeros((), device=device)) + value.detach()
        if step % 100 == 0 or progress >= 1:
            since = step % 100 or 100
            rows.append({"step": step, "rate": rate} | {name: float(value) / since for name, value in kept.items()})
            kept.clear()
            if step % 1000 == 0 or progress >= 1:
                rows[-1] |= {f"held_out_{name}": value for name, value in measures(average.network, data).items()}
                _say(f"{stem} {time.monotonic() - began:.0f} s {_short(rows[-1])}")
                save(options, stem, average.network, rows, data, step)


def save(
    options: argparse.Namespace, stem: str, network: nn.Module, rows: list[dict[str, float]], data: Data, step: int
) -> None:
    """Write the weights and the measurements so far."""
    weights = {name: value.cpu() for name, value in network.state_dict().items()}
    torch.save({"ema": weights, "step": step}, options.out / f"{stem}.pt")
    columns = list(dict.fromkeys(name for row in rows for name in row))
    with (options.out / f"{stem}.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows({name: f"{value:.6g}" for name, value in row.items()} for row in rows)
    settings = {name: str(value) if isinstance(value, Path) else value for name, value in vars(options).items()}
    settings["data"] = [folder.name for folder in options.data]
    settings |= {"steps_done": step, "samples": len(data.training), "held_out": len(data.validation), "last": rows[-1]}
    (options.out / f"{stem}.json").write_text(json.dumps(settings, indent=1, default=str) + "\n")


def _say(text: str) -> None:
    print(text, flush=True)  # noqa: T201  a command's progress


def _short(row: dict[str, float]) -> str:
    return " ".join(f"{name.removeprefix('held_out_')} {value:.4g}" for name, value in row.items())


if __name__ == "__main__":
    main()

"""The loss that the training of both networks minimises."""

from __future__ import annotations

import torch
from foresee_learned.outputs import (
    DENSITY_CHANNELS,
    DENSITY_ROWS,
    FUSION_SAFE_TIMES_S,
    FUSION_TIMES_S,
    SPEED_BINS_MPS,
    TARGET_SPEED_S,
)
from torch import Tensor
from torch.nn import functional

from training.models.fusion import FusionAnswer
from training.models.fusion_safe import FusionSafeAnswer
from training.samples import POINT_S

WEIGHTS = {
    **{"waypoints": 1.0, "target_speed": 0.3, "occupied": 0.4, "users": 0.1, "stop_line": 0.2, "signal": 0.2},
}
"""Ours: chosen so that after some hundred steps the waypoints make up about half of the sum."""
HELPING = 0.5
"""Factor on the weights of the density map, stop line and signal in `fusion`, whose driver does not use these
outputs."""
_USER_SCALE = (1.0, 1.0, 4.0, 2.0, 1.0, 1.0, 8.0)
"""Offsets, length, width (m), cosine, sine, speed (m/s) are divided by these."""
_OCCUPIED_WEIGHT = 4.0
"""Weight of an occupied square relative to an empty one; one of forty is occupied."""
_SLOW_MPS = 3.0
_LEFT_WEIGHT = 2.0
"""Weight of a lateral error relative to one ahead: a driver that cuts a corner by half a metre leaves the road."""


def losses(answer: FusionAnswer | FusionSafeAnswer, batch: dict[str, Tensor]) -> dict[str, Tensor]:
    """Return the parts of the loss, each weighted; their sum is minimised."""
    times = FUSION_TIMES_S if isinstance(answer, FusionAnswer) else FUSION_SAFE_TIMES_S
    wanted = places_at(batch["trajectory"], times)
    off = (answer.waypoints.float() - wanted).abs()
    near = (off[..., 0] + _LEFT_WEIGHT * off[..., 1]).mean(1) / 2
    terms = {"waypoints": near.mean()}
    # Slow speeds decide between waiting and going: a metre counts more there.
    slow = (batch["vector"][:, 0] < _SLOW_MPS) | (wanted[:, -1].norm(dim=1) < _SLOW_MPS)
    terms["waypoints"] = terms["waypoints"] + (near * slow).mean()
    if isinstance(answer, FusionAnswer):
        classes = two_hot(speed_at(batch["trajectory"], TARGET_SPEED_S))
        terms["target_speed"] = functional.cross_entropy(answer.target_speed.float(), classes)
    occupied, users = density_maps(batch)
    density = answer.density.float()
    weight = 1 + (_OCCUPIED_WEIGHT - 1) * occupied
    terms["occupied"] = 10 * functional.binary_cross_entropy_with_logits(density[:, 0], occupied, weight)
    scale = torch.tensor(_USER_SCALE, device=density.device)[None, :, None, None]
    off = functional.smooth_l1_loss(density[:, 1:] / scale, users / scale, reduction="none", beta=0.1).sum(1)
    terms["users"] = (off * occupied).sum() / occupied.sum().clamp(min=1)
    terms["stop_line"] = functional.binary_cross_entropy_with_logits(answer.stop_line[:, 0].float(), batch["stop_line"])
    terms["signal"] = functional.cross_entropy(answer.signal.float(), batch["signal"])
    helping = HELPING if isinstance(answer, FusionAnswer) else 1.0
    leading = ("waypoints", "target_speed")
    return {name: value * WEIGHTS[name] * (1 if name in leading else helping) for name, value in terms.items()}


def places_at(trajectory: Tensor, times_s: tuple[float, ...]) -> Tensor:
    """Return a trajectory [B, 12, 2] at some times, [B, T, 2], straight between its points."""
    points = functional.pad(trajectory, (0, 0, 1, 0))
    place = torch.tensor(times_s, device=trajectory.device) / POINT_S
    before = place.floor().clamp(max=points.shape[1] - 2).long()
    share = (place - before)[None, :, None]
    return points[:, before] * (1 - share) + points[:, before + 1] * share


def speed_at(trajectory: Tensor, time_s: float) -> Tensor:
    """Return the speed on a trajectory [B, 12, 2] at a time, [B] m/s."""
    around = places_at(trajectory, (time_s - POINT_S, time_s + POINT_S))
    return (around[:, 1] - around[:, 0]).norm(dim=1) / (2 * POINT_S)


def two_hot(speed_mps: Tensor) -> Tensor:
    """Return speeds [B] as shares of the two bins of `SPEED_BINS_MPS` around each, [B, bins]."""
    bins = torch.tensor(SPEED_BINS_MPS, device=speed_mps.device)
    speed = speed_mps.clamp(0, float(bins[-1]) - 1e-3)
    low = torch.searchsorted(bins, speed, right=True) - 1
    share = (speed - bins[low]) / (bins[low + 1] - bins[low])
    shares = torch.zeros(len(speed), len(bins), device=speed.device)
    shares.scatter_(1, low[:, None], (1 - share)[:, None])
    return shares.scatter_(1, low[:, None] + 1, share[:, None])


def density_maps(batch: dict[str, Tensor]) -> tuple[Tensor, Tensor]:
    """Return which squares are occupied [B, R, R] (1 or 0), and the map's other channels there [B, 7, R, R]."""
    cells, users = batch["cells"], batch["users"]
    size = DENSITY_ROWS**2
    index = torch.where(cells >= 0, cells, size)  # those that are none go to one place more, which is cut off
    occupied = torch.zeros(len(cells), size + 1, device=cells.device).scatter_(1, index, 1.0)[:, :size]
    values = torch.zeros(len(cells), len(DENSITY_CHANNELS) - 1, size + 1, device=cells.device)
    values.scatter_(2, index[:, None].expand(-1, values.shape[1], -1), users.transpose(1, 2))
    shape = (DENSITY_ROWS, DENSITY_ROWS)
    return occupied.unflatten(1, shape), values[:, :, :size].unflatten(2, shape)

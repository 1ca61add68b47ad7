"""The original's two large layers as products of two thin ones, which answer the same for pictures of nominal driving.

Both layers have 19.7 million weights, but what they give for nominal pictures varies in few directions: the decoder's
input is a curved sheet of two dimensions. The directions are the principal components of the encoder's activations
before the ReLU, and of the decoder's hidden layer; what lies outside of them is replaced by its mean. Then the thin
network is trained a little to redraw the pictures as the large one does.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from copy import deepcopy

import torch
from torch import Tensor, nn

from training.selforacle.autoencoders import COLOURS, COLUMNS, HIDDEN, PIXELS, ROWS, Autoencoder

LARGE = 1_000_000
"""Number of values of a matrix above which it is stored with 8 bits per value, and a scale for each value of the thin
layer."""
Batches = Callable[[], Iterator[Tensor]]


@torch.no_grad()
def shrunk(network: Autoencoder, pictures: Batches, encoder_rank: int, decoder_rank: int) -> Autoencoder:
    """Return a network with thin layers of these widths; the argument is not changed."""
    first, widen, last = network.encoder[1], deepcopy(network.decoder[0]), network.decoder[2]
    seen = _Moments(HIDDEN)
    hidden = _Moments(HIDDEN)
    for batch in pictures():
        before = first(batch.flatten(1))
        seen.add(before)
        hidden.add(torch.relu(widen(network.mean(torch.relu(before)))))
    axes = seen.axes(encoder_rank)  # [512, r]
    down, up = _linear(PIXELS, encoder_rank), _linear(encoder_rank, HIDDEN)
    down.weight.copy_(axes.T @ first.weight)
    down.bias.copy_(axes.T @ (first.bias - seen.mean))
    up.weight.copy_(axes)
    up.bias.copy_(seen.mean)
    axes = hidden.axes(decoder_rank)  # [512, k]
    narrow, out = _linear(HIDDEN, decoder_rank), _linear(decoder_rank, PIXELS)
    narrow.weight.copy_(axes.T)
    narrow.bias.copy_(-axes.T @ hidden.mean)
    out.weight.copy_(last.weight @ axes)
    out.bias.copy_(last.weight @ hidden.mean + last.bias)
    encoder = nn.Sequential(nn.Flatten(), down, up, nn.ReLU())
    decoder = nn.Sequential(widen, nn.ReLU(), narrow, out, nn.Sigmoid(), nn.Unflatten(1, (COLOURS, ROWS, COLUMNS)))
    small = Autoencoder(encoder, HIDDEN, decoder)
    small.mean, small.log_variance = deepcopy(network.mean), deepcopy(network.log_variance)
    return small.to(first.weight.device).eval()


def polished(small: Autoencoder, network: Autoencoder, batches: Iterator[Tensor], learning_rate: float) -> None:
    """Train a network with thin layers to reconstruct pictures as another network does."""
    chosen = [p for name, p in small.named_parameters() if not name.startswith("log_variance")]
    for weight in chosen:
        weight.requires_grad_(True)
    optimiser = torch.optim.Adam(chosen, learning_rate)
    for batch in batches:
        with torch.no_grad():
            wanted = network(batch)
        optimiser.zero_grad(set_to_none=True)
        (small(batch) - wanted).square().mean().backward()
        optimiser.step()


@torch.no_grad()
def rounded(network: Autoencoder) -> Autoencoder:
    """Round all weights but biases as they are stored: thin layers to 8 bits, others to float16."""
    for name, weight in network.named_parameters():
        if not name.endswith("bias"):
            weight.copy_(_to_8_bits(weight) if weight.numel() > LARGE else weight.half().float())
    return network


def _to_8_bits(weight: Tensor) -> Tensor:
    scale = weight.abs().amax(long_axis(tuple(weight.shape)), keepdim=True) / 127
    return torch.round(weight / scale) * scale


def long_axis(shape: tuple[int, ...]) -> int:
    """Return the axis of a thin matrix along which its values share a scale."""
    return 0 if shape[0] > shape[1] else 1


class _Moments:
    """Mean and covariance of many vectors."""

    def __init__(self, size: int) -> None:
        self._count, self._sum, self._products = 0, torch.zeros(size).double(), torch.zeros(size, size).double()

    def add(self, vectors: Tensor) -> None:
        v = vectors.double().cpu() if not vectors.is_cuda else vectors.double()
        self._sum, self._products = self._sum.to(v.device), self._products.to(v.device)
        self._count += len(v)
        self._sum += v.sum(0)
        self._products += v.T @ v

    @property
    def mean(self) -> Tensor:
        return (self._sum / self._count).float()

    def axes(self, rank: int) -> Tensor:
        """Return the directions of most variance, [size, rank], orthonormal."""
        mean = self._sum / self._count
        covariance = self._products / self._count - torch.outer(mean, mean)
        return torch.linalg.eigh(covariance)[1][:, -rank:].flip(1).float()


def _linear(inputs: int, outputs: int) -> nn.Linear:
    return nn.Linear(inputs, outputs).requires_grad_(False)

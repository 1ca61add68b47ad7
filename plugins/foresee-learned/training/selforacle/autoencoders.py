"""SelfOracle's two autoencoders in torch. The `dense` one is the original's; the `conv` one is ours, with few weights.

The original (Stocco et al., ICSE 2020, and the code that its authors published): a picture of 80 x 160 x 3 values from
0 to 1, one dense layer of 512 with ReLU, two layers of 2 (mean and logarithm of the variance), a sample, 512 with ReLU,
and all values of the picture with a sigmoid. The loss is the mean squared error alone: there is no term that keeps the
latent distribution near a normal one.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

ROWS, COLUMNS, COLOURS = 80, 160, 3
PIXELS = ROWS * COLUMNS * COLOURS
HIDDEN, LATENT = 512, 2
CONV_CHANNELS = (16, 32, 64, 64)
"""Numbers of channels. Ours: with 64 x 5 x 10 values between the convolutions and 128 hidden ones, fewer than a million
weights."""
CONV_HIDDEN = 128


class Autoencoder(nn.Module):
    """Both networks; they map pictures [N, 3, 80, 160] with values from 0 to 1 to pictures."""

    def __init__(self, encoder: nn.Module, hidden: int, decoder: nn.Module) -> None:
        super().__init__()
        self.encoder, self.decoder = encoder, decoder
        self.mean, self.log_variance = nn.Linear(hidden, LATENT), nn.Linear(hidden, LATENT)

    def forward(self, pictures: Tensor) -> Tensor:
        """Encode, draw a latent value (during training; otherwise take its mean), decode."""
        hidden = self.encoder(pictures)
        latent = self.mean(hidden)
        if self.training:
            latent = latent + torch.exp(0.5 * self.log_variance(hidden)) * torch.randn_like(latent)
        return self.decoder(latent)

    def errors(self, pictures: Tensor) -> Tensor:
        """Return each picture's mean squared error, [N]."""
        return (self(pictures) - pictures).square().flatten(1).mean(1)


def dense() -> Autoencoder:
    """Return the original's network: 39.4 million weights."""
    encoder = nn.Sequential(nn.Flatten(), nn.Linear(PIXELS, HIDDEN), nn.ReLU())
    decoder = nn.Sequential(
        nn.Linear(LATENT, HIDDEN), nn.ReLU(), nn.Linear(HIDDEN, PIXELS), nn.Sigmoid(),
        nn.Unflatten(1, (COLOURS, ROWS, COLUMNS)),
    )  # fmt: skip
    return _as_keras(Autoencoder(encoder, HIDDEN, decoder))


def conv() -> Autoencoder:
    """Return the convolutional variant: strides of 2 down to 5 x 10, and back."""
    down: list[nn.Module] = []
    before = COLOURS
    for channels in CONV_CHANNELS:
        down += [nn.Conv2d(before, channels, 4, 2, 1), nn.ReLU()]
        before = channels
    rows, columns = ROWS >> len(CONV_CHANNELS), COLUMNS >> len(CONV_CHANNELS)
    flat = before * rows * columns
    encoder = nn.Sequential(*down, nn.Flatten(), nn.Linear(flat, CONV_HIDDEN), nn.ReLU())
    up: list[nn.Module] = [
        nn.Linear(LATENT, CONV_HIDDEN), nn.ReLU(), nn.Linear(CONV_HIDDEN, flat), nn.ReLU(),
        nn.Unflatten(1, (before, rows, columns)),
    ]  # fmt: skip
    for channels in (*CONV_CHANNELS[-2::-1], COLOURS):
        up += [nn.ConvTranspose2d(before, channels, 4, 2, 1), nn.ReLU()]
        before = channels
    return _as_keras(Autoencoder(encoder, CONV_HIDDEN, nn.Sequential(*up[:-1], nn.Sigmoid())))


NETWORKS = {"dense": dense, "conv": conv}


def _as_keras(network: Autoencoder) -> Autoencoder:
    """Initialise like Keras, whose defaults the original uses: Glorot's uniform weights, no biases."""
    for layer in network.modules():
        if isinstance(layer, nn.Linear | nn.Conv2d | nn.ConvTranspose2d):
            nn.init.xavier_uniform_(layer.weight)
            nn.init.zeros_(layer.bias)
    return network

"""Losses and networks, where PyTorch is installed (it is no dependency of the project)."""

from __future__ import annotations

from pathlib import Path

import pytest
from foresee_learned.outputs import FUSION_TIMES_S, SPEED_BINS_MPS

torch = pytest.importorskip("torch", reason="training needs PyTorch")


def test_speeds_come_back_from_their_bins() -> None:
    from training.losses import two_hot

    speeds = torch.tensor([0.0, 0.3, 5.75, 13.0, 24.9])
    shares = two_hot(speeds)
    torch.testing.assert_close(shares @ torch.tensor(SPEED_BINS_MPS), speeds, atol=2e-3, rtol=0.0)
    assert ((shares > 0).sum(1) <= 2).all()


def test_a_trajectory_between_its_points() -> None:
    from training.losses import places_at, speed_at

    times = torch.arange(1, 13) * 0.25
    trajectory = torch.stack((5 * times, -times), 1)[None]
    places = places_at(trajectory, (0.1, *FUSION_TIMES_S, 3.0))
    torch.testing.assert_close(places[0, :, 0], 5 * torch.tensor((0.1, *FUSION_TIMES_S, 3.0)))
    torch.testing.assert_close(speed_at(trajectory, 1.0), torch.tensor([26.0]).sqrt())


@pytest.mark.parametrize("name", ["fusion", "fusion_safe"])
def test_an_exported_network_answers_as_in_training(name: str, tmp_path: Path) -> None:
    from training.export import NETWORKS, export, furthest
    from training.models.blocks import examples

    torch.manual_seed(3)
    trained = NETWORKS[name][0]().eval()
    export(name, trained, tmp_path / "network.onnx")
    assert (tmp_path / "network.onnx").stat().st_size < 8_000_000
    for output, apart in furthest(name, trained, tmp_path / "network.onnx", [examples()]).items():
        assert apart < 0.05, output


def test_a_stem_takes_velocities_as_metres_a_second() -> None:
    from training.models.blocks import USERS, VELOCITY, Reading, Stem

    reading, stem = Reading(), Stem(20, 8)
    picture = torch.zeros(1, 20, 8, 8)
    picture[:, USERS[0]], picture[:, VELOCITY] = 255.0, 128.0 + 5 * 6.0
    channels = torch.einsum("ij,bjkl->bikl", reading.above, picture)
    assert channels[0, VELOCITY, 0, 0].item() == pytest.approx(0.6)
    assert channels[0, USERS[0], 0, 0].item() == pytest.approx(1.0)
    once = stem.eval()(picture, reading.above)
    stem.training = True  # its normalisation is not
    torch.testing.assert_close(stem(picture, reading.above), once)

"""A driver that asks to watch first: commands give its clips that hand-over, unless they are told another."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

import pytest
from foresee_learned.weights import FOLDER_VARIABLE
from training.small_networks import write_networks

from foresee_dsl.language.model import Clip, Ego, Recorded
from foresee_dsl.language.parser import load
from tests.support.command import program
from tests.support.small_street import STREET


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("beside")
    write_networks(folder / "weights")
    (folder / "beside.foresee").write_text(STREET.replace("end after 14 s anywhere", "end after 7 s anywhere"))
    foresee(folder, "run", "beside.foresee", "--driver", "fusion", "--out", "runs", "--exit-zero")
    return folder


def foresee(folder: Path, *words: str) -> str:
    environment = os.environ | {FOLDER_VARIABLE: str(folder / "weights")}
    command = [program(), *words]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr + done.stdout
    return done.stdout


@pytest.mark.parametrize(("options", "watches_s"), [((), 1.0), (("--handover", "0"), 0.0)])
def test_a_clip_of_a_driver_that_remembers(project: Path, options: tuple[str, ...], watches_s: float) -> None:
    window = ("--ranker", "exhaustive", "--rank", "4", "--before", "3", "--after", "2")
    out = foresee(project, "clip", "runs/beside.npz", "--out", "clips", "--json", *window, *options)
    model = load(project / json.loads(out)["clip"]).model
    assert isinstance(model, Clip)
    ego = next(item for item in model.body if isinstance(item, Ego))
    rows = [float(item.time.value) for item in ego.body if isinstance(item, Recorded)]
    assert max(rows, default=0.0) == pytest.approx(watches_s)


def test_a_campaign_settles_on_it(project: Path) -> None:
    words = ("--driver", "fusion", "--children", "0", "--risky-points", "1", "--out", "out", "--exit-zero")
    foresee(project, "campaign", "beside.foresee", *words)
    assert json.loads((project / "out" / "campaign.json").read_text())["settings"]["handover_s"] == 1.0

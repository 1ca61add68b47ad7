"""Drivers that are not deterministic are named, and their findings get rates."""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path

import pytest
from lxml import html

from tests.support import command
from tests.support.small_campaign import SMALL, write_project

SHORT = (*SMALL, "--before", "3", "--after", "3", "--risky-points", "1", "--children", "3", "--jobs", "1",
         "--against", "none")  # fmt: skip
DRIVER = """import random
import threading
import time

from dataclasses import replace

from foresee_dsl.drivers.idm import IdmDriver

WORDS = {f"word {number}" for number in range(100)}


class Chance:
    name, version = "chance", "1"

    def __init__(self, how):
        self.how, self.inner, self.count = how, IdmDriver(), 0

    @classmethod
    def from_argument(cls, text):
        return cls(text)

    def reset(self, mission, vehicle, seed):
        self.inner.reset(mission, vehicle, seed)
        self.random = random.Random()

    def step(self, observation):
        control = self.inner.step(observation)
        return replace(control, throttle=0.1 + 0.01 * self.factor(), brake=0.0)

    def factor(self):
        if self.how == "random":
            return self.random.random()
        if self.how == "time":
            return time.time() % 1
        if self.how == "set":
            return int(next(iter(WORDS))[5:]) / 100
        return self.race()

    def race(self):
        turns = []
        threads = [threading.Thread(target=lambda k=k: (time.sleep(1e-6), turns.append(k))) for k in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        return turns[0] / 4
"""
EXTERNAL = """import json, random, sys
for message in map(json.loads, sys.stdin):
    if message["type"] == "reset":
        answer = {"type": "ready", "name": "coin", "version": "1"}
    elif message["type"] == "step":
        answer = {"steer": 0.0, "throttle": 0.1 + 0.01 * random.random(), "brake": 0.0}
    else:
        break
    print(json.dumps(answer), flush=True)
"""


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """The small project, with the driver `chance` and a program that drives by chance."""
    write_project(tmp_path)
    info = tmp_path / "place" / "chance-1.dist-info"
    info.mkdir(parents=True)
    (tmp_path / "place" / "chance.py").write_text(DRIVER)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: chance\nVersion: 1\n")
    (info / "entry_points.txt").write_text("[foresee_dsl.drivers]\nchance = chance:Chance\n")
    (tmp_path / "coin.py").write_text(EXTERNAL)
    return tmp_path


def campaign(project: Path, driver: str, *, fresh: bool = False) -> tuple[str, dict[str, object]]:
    """Run the campaign; return what the terminal shows, and `campaign.json`.

    `fresh`: findings are repeated in real interpreters, of which each has another order of sets.
    """
    env = {**os.environ, "PYTHONPATH": str(project / "place"), "COLUMNS": "120"}
    env.pop("PYTHONHASHSEED", None)
    done = command.foresee(
        "campaign", "crosser.foresee::after", "--driver", driver, *SHORT, cwd=project, env=env, expect=None, fresh=fresh
    )
    return done.stdout, json.loads((project / "out" / "campaign.json").read_text())


@pytest.mark.parametrize("how", ["chance:random", "chance:time", "chance:set", "chance:race", "program"])
def test_a_driver_that_is_not_deterministic_is_named_and_gets_rates(project: Path, how: str) -> None:
    driver = f"external:{sys.executable} {project / 'coin.py'}" if how == "program" else how
    screen, data = campaign(project, driver, fresh=how == "chance:set")
    assert data["deterministic"] is False
    differing = [finding for finding in data["findings"] if not finding["repeats"]["same"]]  # type: ignore[attr-defined]
    assert differing and all(finding["repeats"]["runs"] == 10 for finding in differing)
    assert "is not deterministic" in screen
    for finding in differing:
        repeats = finding["repeats"]
        assert finding["rate"] == f"{repeats['failed']}/10" and sum(repeats["ends"].values()) == 10
    page = html.document_fromstring((project / "out" / "report.html").read_text()).text_content()
    assert "is not deterministic" in page and f"fails in {differing[0]['rate']} runs" in page


def test_a_deterministic_driver_is_run_twice_and_keeps_its_verdicts(project: Path) -> None:
    screen, data = campaign(project, "idm")
    assert data["deterministic"] is True and "not deterministic" not in screen and data["findings"]
    for finding in data["findings"]:  # type: ignore[attr-defined]
        assert finding["repeats"] == {"runs": 2, "failed": 2, "ends": {finding["verdict"]: 2}, "same": True}
        assert finding["rate"] is None
    rows = command.foresee("store", "stat", "out/store", "--json", cwd=project).stdout
    assert json.loads(rows)["kinds"]["repeat"] == {"": len(data["findings"])}  # type: ignore[arg-type]
    campaign(project, "idm")
    assert (
        json.loads(command.foresee("store", "stat", "out/store", "--json", cwd=project).stdout)["kinds"]
        == (json.loads(rows)["kinds"])
    )

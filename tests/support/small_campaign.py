"""A project whose campaign takes seconds: one crossing, three cases of a car that crosses, the driver `idm`."""

from __future__ import annotations

import fcntl
import json
import os
import shutil
from collections.abc import Callable, Generator, Iterator
from pathlib import Path
from typing import Any

from foresee_dsl.campaign.execution.engine import Listener, run_campaign
from foresee_dsl.campaign.results import CampaignResult
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.campaign.storage.store import Store, StoredResult
from foresee_dsl.campaign.workers.pool import Executor, RunOptions, TaskPart, Update
from foresee_dsl.language.project.loading import load_test_cases
from foresee_dsl.simulate.trace import Trace

TEXT = """foresee 1

# Somebody crosses in front of the ego, and just makes it.
scenario crosser {
  network crossing {
    junction west at (0 m, 0 m)
    junction east at (160 m, 0 m)
    junction south at (80 m, -80 m)
    junction north at (80 m, 80 m)
    junction middle at (80 m, 0 m)
    road in from west to middle { lanes 1; speed 60 km/h }
    road out from middle to east { lanes 1; speed 60 km/h }
    road up from south to middle { lanes 1; speed 30 km/h }
    road on from middle to north { lanes 1; speed 30 km/h }
  }
  param gap: time = 1.5 s in -4 s..4 s step 0.1 s

  ego: car.sedan {
    route [in, out]
    start at 25 m along in
    start speed 36 km/h
    goal 30 m along out
  }
  vehicle other: car.compact {
    route [up, on]
    start at 30 m along up
    speed 40 km/h
  }

  when ego.eta(middle) < 4 s {
    other meets ego at middle after gap
    other ignores priority at middle
  }

  expect never collision(ego)
  end after 12 s

  case after { gap = -0.8 s }
  case later { gap = -0.7 s }
  case last { gap = -0.9 s }
}
"""
SETTINGS = CampaignSettings(
    driver="idm", ranker="foresee", preset="focused", before_s=3, after_s=3, risky_points=2, children=4
)
SMALL = ("--ranker", "foresee", "--preset", "focused")
"""Options with which each clip has as many mutants as are asked for."""


def write_project(folder: Path) -> Path:
    """Write the scenario and return its file."""
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / "crosser.foresee"
    file.write_text(TEXT)
    return file


class InThisProcess(Executor):
    """Runs tasks one after the other, without workers."""

    def __init__(self, options: RunOptions) -> None:
        super().__init__()

    def updates(self, stop: Callable[[], bool] = lambda: False) -> Iterator[list[Update]]:
        while self._queue and not stop():
            task = self._tasks.pop(*self._queue.take())
            value = task.function(task.argument)
            if not isinstance(value, Generator):
                yield [Update(task, value)]
                continue
            for part in value:
                yield [Update(task, TaskPart(part))]
            yield [Update(task, None)]

    def close(self) -> None:
        pass


class Heard(Listener):
    """Remembers which steps were done, and which were known."""

    def __init__(self) -> None:
        self.kinds: list[str] = []
        self.names: list[str] = []
        self.old: list[str] = []

    def done(self, row: StoredResult, *, new: bool = True) -> None:
        if new:
            self.kinds.append(row.kind)
            self.names.append(row.name)
        else:
            self.old.append(row.kind)

    def count(self, kind: str) -> int:
        return self.kinds.count(kind)


def campaign(
    file: Path | list[Path],
    out: Path,
    settings: CampaignSettings = SETTINGS,
    *,
    store: Path | None = None,
    options: RunOptions | None = None,
    heard: Heard | None = None,
) -> tuple[CampaignResult, Heard]:
    """Run a campaign in this process's workers."""
    heard = heard or Heard()
    cases = load_test_cases(file if isinstance(file, list) else [file])
    with Store(store or out / "store") as opened:
        result = run_campaign(
            cases, settings, out=out, store=opened, listeners=[heard], options=options or RunOptions()
        )
    return result, heard


def finished(file: Path | list[Path], out: Path, settings: CampaignSettings = SETTINGS) -> CampaignResult:
    """Run a campaign for a test of what is done with its results: it takes runs of the small one from a shared store.

    The store is copied to `out`, so tests share no file.
    """
    copy_runs(out)
    return campaign(file, out, settings)[0]


def copy_runs(out: Path) -> None:
    """Give a campaign its store in an empty folder, with the runs of the small campaign: it runs only what is new."""
    shutil.copytree(_shared_store(), out / "store")


def _shared_store() -> Path:
    """Run the small campaign, unless a test of any worker has done so; return its store."""
    folder = Path(os.environ["FORESEE_CACHE"]).with_name("small_campaign")
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not (folder / "whole").exists():
            campaign(write_project(folder / "project"), folder / "out")
            (folder / "whole").touch()
    return folder / "out" / "store"


def published(out: Path) -> dict[str, Any]:
    """Everything in a campaign's folder that has to be the same for the same results: files by name, what
    traces hold, and the JSON."""
    data = json.loads((out / "campaign.json").read_text())
    folders = [out / "children", out / "findings"]
    written = sorted(f for folder in folders for f in folder.rglob("*.foresee"))
    files = {str(f.relative_to(out)): f.read_bytes() for f in written}
    kept = sorted([*(out / "traces").rglob("*.npz"), *(out / "findings").rglob("*.npz")])
    traces = {str(f.relative_to(out)): Trace.load(f).digest for f in kept}
    return {"json": {**data, "wall_s": 0}, "files": files, "traces": traces}

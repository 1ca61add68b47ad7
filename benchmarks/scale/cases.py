"""Measures a campaign of 1,000 test cases from the library: memory over time, and CPU of plan, resume and report."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from benchmarks.scale.actors import power
from benchmarks.sections import table
from foresee_dsl.campaign.execution.engine import Listener, run_campaign
from foresee_dsl.campaign.plan import plan_campaign
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.campaign.stages import Stages
from foresee_dsl.campaign.storage.store import Store, StoredResult
from foresee_dsl.campaign.workers.pool import RunOptions, WorkerPool
from foresee_dsl.files import data_folder
from foresee_dsl.language.project.loading import load_test_cases
from foresee_dsl.report.page.html import write_report

CASES = 1000
JOBS = 2
SETTINGS = CampaignSettings(
    ranker="foresee", preset="focused", before_s=3.0, after_s=2.0, risky_points=1, children=1, against=()
)
SAMPLES = 10
_SHORT = """foresee 1

# Of the library's test case, in one street and short.
scenario many extends "{library}" {{
  change param approach: arm = king_west in [king_west]
  change param first: junction = king_oak in [king_oak]
  change param first_way: turn = straight in [straight]
  change param last: junction = king_elm in [king_elm]
  change param runner_from: arm = elm_north in [elm_north]
  change param notice: time = 8.5 s in 8 s..9 s step 0.1 s
  change traffic others {{ count 3; models [car.hatchback, car.wagon]; within 90 m of ego.route; seed traffic_seed }}
  change traffic strollers {{ count 1; models [pedestrian.adult]; within 30 m of ego.route; seed traffic_seed }}
  change ego: car.sedan {{
    route from approach first_way over first straight over last
    start at 60 m before last on ego.route
    start speed 40 km/h
    speed cruise
    goal 10 m past last on ego.route
  }}
  drop case van_from_the_left
  drop case sports_car_from_the_right
  drop case motorcycle_in_low_sun
  drop case lorry_in_the_rain
  add cases {count} from seed 7
  change signal king_elm stage ew_go elapsed 2 s
  change end after 14 s
}}
"""


class Memory(Listener):
    """Records the memory of the campaign's process and of its largest worker as results arrive."""

    def __init__(self, every: int) -> None:
        self._every = every
        self._done = 0
        self.pool: WorkerPool | None = None
        self.samples: list[tuple[int, float, float]] = []
        """Samples: number of results, MB of this process, MB of the largest worker."""

    def done(self, row: StoredResult, *, new: bool = True) -> None:  # noqa: ARG002 - the interface of listeners
        """Take a sample after each `every` results."""
        self._done += 1
        if self._done % self._every == 0 and self.pool is not None:
            workers = max((resident_mb(str(pid)) for pid in self.pool.pids), default=0.0)
            self.samples.append((self._done, resident_mb(), workers))


def resident_mb(pid: str = "self") -> float:
    """Return the current memory of a process, MB; 0 if the system does not report it."""
    try:
        status = Path(f"/proc/{pid}/status").read_text(encoding="ascii", errors="replace")
    except OSError:
        return 0.0
    lines = (line.split() for line in status.splitlines() if line.startswith("VmRSS:"))
    return next((int(words[1]) * 1024 / 1e6 for words in lines), 0.0)


def measure(count: int) -> dict[str, Any]:
    """Run a campaign of `count` test cases, then plan, resume and report it; return seconds, and memory over time."""
    library = data_folder("scenarios") / "scenario7" / "from_the_side.foresee"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        file, out = folder / "many.foresee", folder / "out"
        file.write_text(_SHORT.format(library=library.as_posix(), count=count), encoding="utf-8")
        seconds, began = {}, time.process_time()
        cases = load_test_cases([file], allow_outside=True)
        seconds["load_s"] = time.process_time() - began
        memory = Memory(max(1, 5 * count // SAMPLES))

        def pool(options: RunOptions) -> WorkerPool:
            memory.pool = WorkerPool(options.jobs)
            return memory.pool

        with Store(out / "store") as store:
            began = time.process_time()
            plan_campaign(Stages(cases, SETTINGS, store, out), store, jobs=JOBS)
            seconds["plan_before_s"] = time.process_time() - began
            started, began = time.perf_counter(), time.process_time()
            options = RunOptions(jobs=JOBS, executor=pool)
            result = run_campaign(cases, SETTINGS, out=out, store=store, listeners=[memory], options=options)
            wall_s, seconds["parent_s"] = time.perf_counter() - started, time.process_time() - began
            if result.broken:
                raise RuntimeError(f"the campaign did not go through: {result.broken[:3]}")
            began = time.process_time()
            plan_campaign(Stages(cases, SETTINGS, store, out), store, jobs=JOBS)
            seconds["plan_after_s"] = time.process_time() - began
            began = time.process_time()
            run_campaign(cases, SETTINGS, out=out, store=store, options=options)
            seconds["resume_s"] = time.process_time() - began
        began = time.process_time()
        write_report([out], folder / "report.html")
        seconds["report_s"] = time.process_time() - began
    runs = len(result.seeds) + len(result.clips) + result.row().children
    return {"cases": count, "runs": runs, "wall_s": wall_s, "took": seconds, "memory": memory.samples}


def _alone(count: int) -> dict[str, Any]:
    """Run `measure` in a process of its own, and return its result."""
    command = [sys.executable, "-m", "benchmarks.scale.cases", str(count)]
    done = subprocess.run(command, stdout=subprocess.PIPE, check=True)  # noqa: S603 - ourselves
    result: dict[str, Any] = json.loads(done.stdout)
    return result


def text(most: int = CASES) -> str:
    """Measure, and return the tables."""
    results = [_alone(count) for count in (most // 4, most // 2, most)]
    memory = table(
        (
            f"campaign of {most:,} test cases, {results[-1]['runs']:,} runs",
            "campaign's process MB",
            "largest worker MB",
        ),
        ((f"after {done:,} results", f"{own:.0f}", f"{worker:.0f}") for done, own, worker in results[-1]["memory"]),
    )
    names = {"load_s": "loading", "plan_before_s": "plan, nothing run yet", "parent_s": "the campaign's own process",
             "plan_after_s": "plan of what is done", "resume_s": "resume", "report_s": "report page"}  # fmt: skip
    rows = []
    for key, title in names.items():
        each = [result["took"][key] for result in results]
        rows.append((title, *(f"{value:.2f}" for value in each), f"{power(each[0], each[-1], 4):.2f}"))
    headings = ("s of CPU", *(f"{result['cases']:,} test cases" for result in results), "power")
    return f"{memory}\n{table(headings, rows)}"


if __name__ == "__main__":
    sys.stdout.write(json.dumps(measure(int(sys.argv[1]))))

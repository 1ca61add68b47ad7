"""Records the expert's driving: `python -m training.record --hours 17 --seed 1 --out FOLDER --jobs 2`.

The expert is `pdm` with ideal sensors; the recorded observations are those of the standard sensors. The same hours and
seed give the same files for any number of jobs.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path

from foresee_dsl.compile import compile_test_case
from foresee_dsl.drivers.protocol import Driver
from foresee_dsl.errors import ForeseeError
from foresee_dsl.language.project.loading import Project
from training.driving import record
from training.plan import Item, bundled_meanings, loaded, plan
from training.samples import RecordedRun
from training.shards import write_shard

CARLA = Path(__file__).resolve().parents[4] / "shared" / "data" / "carla"
"""CARLA's maps beside the project, if they are there."""


@dataclass(frozen=True)
class Job:
    """A piece of a plan, and its output file.

    Attributes:
        bundled: meanings of the bundled test cases.
        pupil: creates the driver to be recorded; None: the expert drives.
        share: see `driving.record`.
    """

    items: tuple[Item, ...]
    out: Path
    bundled: frozenset[str]
    pupil: Callable[[], Driver] | None = None
    share: float = 0.0


@dataclass
class Tally:
    """Counts of recorded runs and frames."""

    runs: int = 0
    driven_s: float = 0.0
    samples: int = 0
    bytes: int = 0
    impossible: int = 0
    verdicts: Counter[str] = field(default_factory=Counter)
    families: Counter[str] = field(default_factory=Counter)

    def add(self, other: Tally) -> None:
        """Add another tally."""
        for name in ("runs", "driven_s", "samples", "bytes", "impossible"):
            setattr(self, name, getattr(self, name) + getattr(other, name))
        self.verdicts.update(other.verdicts)
        self.families.update(other.families)

    def text(self) -> str:
        """Return the tally in one line."""
        verdicts = ", ".join(f"{count} {name}" for name, count in self.verdicts.most_common())
        return (
            f"{self.runs} runs, {self.driven_s / 3600:.2f} h, {self.samples} samples, {self.bytes / 2**20:.2f} MiB, "
            f"{self.impossible} impossible; {verdicts}"
        )


def record_piece(job: Job) -> Tally:
    """Record a piece and write its file."""
    runs: list[RecordedRun] = []
    tally, project = Tally(), Project()
    pupil = job.pupil() if job.pupil is not None else None
    for item in job.items:
        case = loaded(project, item, job.bundled)
        if case is None:
            tally.impossible += 1
            continue
        about = {
            "name": Path(item.address).name,
            "family": item.family,
            "hash": case.meaning,
            "driver": pupil.name if pupil is not None else "expert",
        }
        try:
            run, result = record(
                compile_test_case(case), item.seed, about, disturbance=item.disturbance, pupil=pupil,
                share=job.share,
            )  # fmt: skip
        except ForeseeError:  # the drawn case cannot be placed
            tally.impossible += 1
            continue
        tally.runs += 1
        tally.driven_s += result.duration_s
        tally.verdicts[result.verdict.value] += 1
        tally.families[item.family] += round(result.duration_s)
        if run is not None:
            runs.append(run)
            tally.samples += len(run.label_rows)
    if runs:
        write_shard(job.out, runs)
        tally.bytes = job.out.stat().st_size
    return tally


def record_all(jobs: Sequence[Job], processes: int) -> Tally:
    """Record all pieces, and print a line for each."""
    began, total = time.monotonic(), Tally()
    with get_context("spawn").Pool(processes) as pool:
        for count, tally in enumerate(pool.imap_unordered(record_piece, jobs), 1):
            total.add(tally)
            print(f"{count}/{len(jobs)} {time.monotonic() - began:.0f} s: {total.text()}", flush=True)  # noqa: T201
    driven = ", ".join(f"{name} {seconds / 3600:.2f} h" for name, seconds in sorted(total.families.items()))
    print(driven, flush=True)  # noqa: T201
    return total


def main() -> None:
    """Read the command line and record."""
    parser = argparse.ArgumentParser(prog="python -m training.record", description="Record the expert's driving.")
    parser.add_argument("--hours", type=float, required=True, help="how long is driven, in simulated time")
    parser.add_argument("--seed", type=int, required=True, help="what cases, towns and disturbances are drawn from")
    parser.add_argument("--out", type=Path, required=True, help="folder of the files")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--name", default="round0", help="what the files' names begin with")
    parser.add_argument("--carla", type=Path, default=CARLA, help="folder of CARLA's maps")
    options = parser.parse_args()
    work = options.out / "work"
    carla = options.carla if options.carla.is_dir() else None
    pieces = plan(options.hours, options.seed, work, carla=carla)
    bundled = bundled_meanings()
    jobs = [Job(items, options.out / f"{options.name}_{k:03d}.npz", bundled) for k, items in enumerate(pieces)]
    record_all(jobs, options.jobs)


if __name__ == "__main__":
    main()

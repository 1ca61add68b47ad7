"""Kills campaigns, and workers of campaigns, at random moments, and looks whether anything is lost or counted twice.

By hand, for long: `python tests/support/chaos.py --kills 50`.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from tests.support.command import program
from tests.support.small_campaign import SMALL, published, write_project

FORESEE = Path(sys.executable).parent / "foresee"
OPTIONS = (*SMALL, "--driver", "idm", "--before", "3", "--after", "3", "--quiet", "--json")
LONGEST_S = 300
"""A campaign that has not ended by then never will."""


@dataclass
class Findings:
    """The result of disturbed campaigns.

    Attributes:
        ends: number of processes by the way in which they ended.
        killed: number of kills by target.
        done: names of the steps that the logs call done.
    """

    ends: Counter[str] = field(default_factory=Counter)
    killed: Counter[str] = field(default_factory=Counter)
    done: Counter[str] = field(default_factory=Counter)

    def read(self, log: Path) -> None:
        """Count the steps that a log says were done; a killed process's last line may be cut off."""
        for line in log.read_text().splitlines() if log.exists() else ():
            try:
                event = json.loads(line)
            except ValueError:
                continue
            if event["event"] == "done":
                self.done[event["key"]] += 1


def undisturbed(file: Path, out: Path, more: Sequence[str] = ()) -> None:
    """Run the campaign without any harm."""
    subprocess.run(
        [program(), "campaign", file, "--out", out, "--exit-zero", *OPTIONS, *more],
        check=True,
        stdout=subprocess.DEVNULL,
    )


def disturbed(file: Path, out: Path, *, kills: int, lots: random.Random, more: Sequence[str] = ()) -> Findings:
    """Run the campaign to its end, whatever happens, with so many kills on the way.

    After a campaign has ended by itself, the next begins with an empty store until all kills are used.
    """
    found = Findings()
    left, attempt, finished = kills, 0, False
    while not finished or left > 0:
        if finished:  # more kills are asked for than one campaign outlives
            (out / "store" / "runs.sqlite").unlink()
            found.done.clear()
        attempt += 1
        log = out.parent / f"log{attempt}.jsonl"
        process = subprocess.Popen(
            [FORESEE, "campaign", file, "--out", out, "--jobs", "2", "--log-json", log, "--exit-zero", *OPTIONS, *more],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        left = _harm(process, left, found, lots)
        process.wait(timeout=LONGEST_S)
        found.ends[str(process.returncode)] += 1
        found.read(log)
        finished = process.returncode == 0
    return found


def _harm(process: subprocess.Popen[bytes], left: int, found: Findings, lots: random.Random) -> int:
    """Kill this and that until the campaign ends or no kill is left; return how many are left."""
    began = time.monotonic()
    while left and process.poll() is None and time.monotonic() - began < LONGEST_S:
        time.sleep(lots.uniform(0.3, 2.5))
        below = _below(process.pid)
        if process.poll() is not None or not below:
            continue
        left -= 1
        who = lots.choice(("parent", "worker", "worker", "fork server", "SIGTERM", "SIGINT"))
        found.killed[who] += 1
        # The oldest of the processes below is the fork server's tracker or itself, the youngest ones are workers.
        target = {"worker": below[-1], "fork server": below[min(1, len(below) - 1)]}.get(who, process.pid)
        number = {"SIGTERM": signal.SIGTERM, "SIGINT": signal.SIGINT}.get(who, signal.SIGKILL)
        try:
            os.kill(target, number)
        except ProcessLookupError:
            continue
    return left


def _below(pid: int) -> list[int]:
    """Return the processes below one, by number (which grows with age's opposite)."""
    parents = {}
    for status in Path("/proc").glob("[0-9]*/stat"):
        try:
            parents[int(status.parent.name)] = int(status.read_text().rpartition(")")[2].split()[1])
        except OSError:
            continue
    found, last = {pid}, set[int]()
    while found != last:
        last = set(found)
        found |= {child for child, parent in parents.items() if parent in found}
    return sorted(found - {pid})


def check(file: Path, folder: Path, *, kills: int, seed: int, more: Sequence[str] = ()) -> Findings:
    """Do both, and compare.

    Raises:
        AssertionError: something was lost, done twice, or came out differently.
    """
    calm, out = folder / "calm" / "out", folder / "wild" / "out"
    undisturbed(file, calm, more)
    found = disturbed(file, out, kills=kills, lots=random.Random(seed), more=more)
    twice = [key for key, count in found.done.items() if count > 1]
    assert not twice, f"done more than once: {twice}"
    assert published(out) == published(calm), "the reports differ"
    assert not list(out.glob(".work-*")), "a working folder is left"
    again = subprocess.run(
        [
            program(),
            "campaign",
            file,
            "--out",
            out,
            "--log-json",
            out.parent / "last.jsonl",
            "--exit-zero",
            *OPTIONS,
            *more,
        ],
        check=True,
        stdout=subprocess.DEVNULL,
    )
    assert again.returncode == 0
    last = Findings()
    last.read(out.parent / "last.jsonl")
    assert not last.done, f"run again after the end: {last.done}"
    return found


def main() -> None:
    """Do it by hand."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--children", type=int, default=12)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        began = time.monotonic()
        found = check(
            write_project(Path(folder) / "project"),
            Path(folder),
            kills=arguments.kills,
            seed=arguments.seed,
            more=("--children", str(arguments.children)),
        )
        sys.stdout.write(
            f"{sum(found.killed.values())} kills ({dict(found.killed)}), ends {dict(found.ends)}, "
            f"{len(found.done)} steps done, none twice, same report; {time.monotonic() - began:.0f} s\n"
        )


if __name__ == "__main__":
    main()

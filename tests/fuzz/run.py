"""The fuzzer's command line: `python -m tests.fuzz.run --inputs 100000 --seed 1 --jobs 2`, from the checkout.

Every finding is minimised and written to a folder; the exit code is 1 if there is any. Input NUMBER of a generator is
shown with `--show GENERATOR:NUMBER`.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import resource
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from pathlib import Path

from tests.fuzz.generators import GENERATORS, make
from tests.fuzz.minimise import minimise
from tests.fuzz.oracle import MOST_MEMORY_MB, Judge, peak_mb

_REPORT_EVERY = 200
_HARD_LIMIT = 4 * MOST_MEMORY_MB * 1_000_000
"""Address space of a worker in bytes: an input that wants more ends in a MemoryError, and the machine goes on."""


@dataclass
class Result:
    """What a run has seen; `findings` by their key, each with the input that showed it first."""

    inputs: Counter[str] = field(default_factory=Counter)
    accepted: Counter[str] = field(default_factory=Counter)
    slowest: tuple[float, str] = (0.0, "")
    peak_mb: float = 0.0
    findings: dict[str, tuple[str, str, bytes]] = field(default_factory=dict)  # key: (which, details, input)

    def add(self, other: Result) -> None:
        """Add what another process has seen."""
        self.inputs.update(other.inputs)
        self.accepted.update(other.accepted)
        self.slowest = max(self.slowest, other.slowest)
        self.peak_mb = max(self.peak_mb, other.peak_mb)
        for key, finding in other.findings.items():
            self.findings.setdefault(key, finding)


def fuzz(judge: Judge, names: list[str], seed: int, numbers: range, known: set[str]) -> Result:
    """Judge inputs of all generators in turn; what is wrong is minimised, once for each key that is not known yet."""
    result = Result()
    for number in numbers:
        name = names[number % len(names)]
        which = f"{name}:{number}"
        content = make(name, seed, number)
        begun, accepted = time.process_time(), judge.documents
        found = judge.judge(content)
        result.inputs[name] += 1
        result.accepted[name] += judge.documents - accepted
        result.slowest = max(result.slowest, (time.process_time() - begun, which))
        if found is None or found.key in known:
            continue
        known.add(found.key)

        def still(smaller: bytes, key: str = found.key) -> bool:
            again = judge.judge(smaller)
            return again is not None and again.key == key

        costly = found.key.startswith(("memory", "slow"))  # every try would cost as much
        small = content if costly else minimise(content, still)
        result.findings[found.key] = (which, found.details, small)
    result.peak_mb = peak_mb()
    return result


def _work(pipe: Connection, names: list[str], seed: int, numbers: range) -> None:
    resource.setrlimit(resource.RLIMIT_AS, (_HARD_LIMIT, _HARD_LIMIT))
    known: set[str] = set()
    with tempfile.TemporaryDirectory() as folder:
        judge = Judge(Path(folder))
        for k in range(0, len(numbers), _REPORT_EVERY):
            part = numbers[k : k + _REPORT_EVERY]
            pipe.send(part)  # what is being looked at, should this process die of it
            pipe.send(fuzz(judge, names, seed, part, known))
    pipe.close()


def _say(text: str) -> None:
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


def run(names: list[str], seed: int, inputs: int, jobs: int) -> Result:
    """Judge many inputs in several processes, and print how far they are."""
    context = multiprocessing.get_context("spawn")
    total, begun, printed = Result(), time.monotonic(), 0
    pipes: dict[Connection, range] = {}
    for job in range(jobs):
        ours, theirs = context.Pipe(duplex=False)
        context.Process(target=_work, args=(theirs, names, seed, range(job, inputs, jobs)), daemon=True).start()
        theirs.close()
        pipes[ours] = range(0)
    while pipes:
        for pipe in wait(list(pipes)):
            assert isinstance(pipe, Connection)
            try:
                message = pipe.recv()
            except EOFError:
                at = pipes.pop(pipe)
                if at:
                    total.findings[f"died {at}"] = (str(at), "the process ended while it looked at these inputs", b"")
                continue
            if isinstance(message, range):
                pipes[pipe] = message
                continue
            pipes[pipe] = range(0)
            total.add(message)
            for key in message.findings:
                _say(f"found: {key} ({message.findings[key][0]})")
        if (done := total.inputs.total()) >= printed + 5_000:
            printed = done
            _say(f"{done} inputs, {time.monotonic() - begun:.0f} s, {len(total.findings)} findings")
    return total


def save(result: Result, folder: Path) -> None:
    """Write the findings: the minimised input, and beside it what is wrong with it."""
    for k, (key, (which, details, content)) in enumerate(sorted(result.findings.items())):
        folder.mkdir(parents=True, exist_ok=True)
        (folder / f"finding_{k:02}.foresee").write_bytes(content)
        (folder / f"finding_{k:02}.txt").write_text(f"{key}\n{which}\n\n{details}\n", encoding="utf-8")


def main() -> int:
    """Run the fuzzer; return 1 if anything was found."""
    options = argparse.ArgumentParser(description="Fuzz the language.")
    options.add_argument("--inputs", type=int, default=100_000, help="how many, of all generators together")
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    options.add_argument("--generators", default=",".join(GENERATORS))
    options.add_argument("--out", type=Path, default=Path("fuzz-findings"))
    options.add_argument("--show", metavar="GENERATOR:NUMBER", help="print one input and stop")
    given = options.parse_args()
    if given.show:
        name, _, number = given.show.partition(":")
        sys.stdout.buffer.write(make(name, given.seed, int(number)))
        return 0
    begun = time.monotonic()
    result = run(given.generators.split(","), given.seed, given.inputs, given.jobs)
    save(result, given.out)
    counts = ", ".join(f"{n} {name} ({result.accepted[name]} accepted)" for name, n in sorted(result.inputs.items()))
    _say(f"{result.inputs.total()} inputs ({counts}), seed {given.seed}, {time.monotonic() - begun:.0f} s")
    _say(f"slowest {result.slowest[0]:.2f} s of CPU ({result.slowest[1]}), peak memory {result.peak_mb:.0f} MB")
    _say(f"{len(result.findings)} findings" + (f" in {given.out}" if result.findings else ""))
    return 1 if result.findings else 0


if __name__ == "__main__":
    sys.exit(main())

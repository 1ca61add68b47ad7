"""The command `python -m foresee_study.faults`; `make faults` runs it with the options in ARGS."""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from foresee_study.faults.approaches import APPROACHES, DEFAULT
from foresee_study.faults.plug_in_path import add_plug_in

FEW = (
    "pdm/late_objects", "pdm/blind_to_walkers", "pdm/forgets_hidden", "pdm/weak_brakes", "pdm/overtrusts_signals",
    "pdm/small_gap_left",
)  # fmt: skip
"""The faults that `make faults` seeds by default."""


def main(words: Sequence[str] | None = None) -> int:
    """Run the benchmark, print its tables, and write `faults.md` and `faults.json`."""
    add_plug_in()
    from foresee_faults.catalogue import KINDS  # type: ignore[import-not-found, unused-ignore]

    from foresee_study.faults.benchmark import Plan, all_kinds, measure
    from foresee_study.faults.table import Benchmark, as_json, as_markdown
    from foresee_study.halves import Half

    args = _parser().parse_args(words)
    if args.list:
        sys.stdout.write(listed(KINDS) + "\n")
        return 0
    kinds = all_kinds(KINDS)
    faults = {"all": kinds, "few": FEW}.get(args.faults) or _named(args.faults.split(","))
    if args.causes:
        return _causes(args, faults, {name: kind.part for name, kind in KINDS.items()})
    if args.judgement:
        return _judgement(args, faults)
    plan = Plan(
        faults=faults,
        strengths=tuple(sorted(float(text) for text in args.strengths.split(","))),
        approaches=tuple(APPROACHES[each] for each in _chosen(args.approaches.split(","))),
        half=Half(args.half),
        cases=args.cases,
        simulated_s=args.seconds_simulated,
        judges=tuple(each for each in args.judges.split(",") if each not in ("", "none")),
        jobs=args.jobs,
        out=args.out,
        bisects=not args.all_strengths,
        ends_s=time.time() + 60 * args.minutes,
    )

    def write(benchmark: Benchmark) -> None:
        args.out.mkdir(parents=True, exist_ok=True)
        (args.out / "faults.md").write_text(as_markdown(benchmark), encoding="utf-8")
        (args.out / "faults.json").write_text(json.dumps(as_json(benchmark), indent=1) + "\n", encoding="utf-8")

    benchmark = measure(plan, lambda line: print(line, file=sys.stderr, flush=True), write)  # noqa: T201
    sys.stdout.write(as_markdown(benchmark))
    return 0


def _causes(args: argparse.Namespace, faults: Sequence[str], parts: Mapping[str, Any]) -> int:
    """Diagnose failures of the faults, print the confusion table, and write `causes.md` and `causes.json`."""
    from foresee_study.faults.causes import causes_json, causes_table, measure_causes
    from foresee_study.halves import Half

    named = measure_causes(
        faults, parts, half=Half(args.half), strength=args.strength, cases=args.cases, failures=args.failures,
        ends_s=time.time() + 60 * args.minutes, jobs=args.jobs,
        say=lambda line: print(line, file=sys.stderr, flush=True),  # noqa: T201
    )  # fmt: skip
    table = causes_table(named) + "\n"
    args.out.mkdir(parents=True, exist_ok=True)
    (args.out / "causes.md").write_text(table, encoding="utf-8")
    (args.out / "causes.json").write_text(json.dumps(causes_json(named), indent=1) + "\n", encoding="utf-8")
    sys.stdout.write(table)
    return 0


def _judgement(args: argparse.Namespace, faults: Sequence[str]) -> int:
    """Judge failures with and without a fault, print the accuracy, and write `judgement.md` and `judgement.json`."""
    from foresee_study.faults.judgement import judgement_json, judgement_table, measure_judgement
    from foresee_study.faults.sampling import library
    from foresee_study.halves import Half

    failures = measure_judgement(
        library(Half(args.half)), faults, tuple(float(text) for text in args.strengths.split(",")),
        out=args.out, jobs=args.jobs, ends_s=time.time() + 60 * args.minutes,
        say=lambda line: print(line, file=sys.stderr, flush=True),  # noqa: T201
    )  # fmt: skip
    table = judgement_table(failures) + "\n"
    (args.out / "judgement.md").write_text(table, encoding="utf-8")
    (args.out / "judgement.json").write_text(json.dumps(judgement_json(failures), indent=1) + "\n", encoding="utf-8")
    sys.stdout.write(table)
    return 0


def listed(kinds: Mapping[str, Any]) -> str:
    """Return the kinds of fault as the Markdown table in `docs/background/faults.md`."""
    rows = [f"| `{name}` | {k.what} | {k.cause} | {k.scale} | {k.source} |" for name, k in kinds.items()]
    return "\n".join(
        ["| kind | what the driver does | cause | strength from 0 to 1 | source |", "|" + " --- |" * 5, *rows]
    )


def _named(names: Sequence[str]) -> tuple[str, ...]:
    """Return the faults that a user names; a kind without a driver is seeded into `pdm`."""
    from foresee_faults.catalogue import KINDS  # type: ignore[import-not-found, unused-ignore]

    faults = tuple(name if "/" in name else f"pdm/{name}" for name in names)
    for name in faults:
        if name.partition("/")[2] not in KINDS:
            sys.exit(f"there is no kind of fault {name!r}; write one of {', '.join(KINDS)}")
    return faults


def _chosen(names: Sequence[str]) -> Sequence[str]:
    for name in names:
        if name not in APPROACHES:
            sys.exit(f"there is no approach {name!r}; write one of {', '.join(APPROACHES)}")
    return names


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m foresee_study.faults", description=__doc__)
    add = parser.add_argument
    add(
        "--faults",
        default="few",
        help="all, few (six of pdm), or names separated by commas: pdm/late_objects,idm/runs_amber",
    )
    add(
        "--strengths",
        default="0.1,0.2,0.4,0.7,1",
        help="strengths of the faults, separated by commas; approaches are compared at the middle strength",
    )
    add("--approaches", default=",".join(DEFAULT), help=f"of {', '.join(APPROACHES)}")
    add(
        "--half",
        choices=("even", "odd", "all"),
        default="even",
        help="half of the test cases, by whether the hash of a name is even",
    )
    add("--cases", type=int, default=5, help="number of test cases of each fault")
    add("--seconds-simulated", type=float, default=600.0, help="simulated seconds that each search may use")
    add("--judges", default="idm,frenetix,pdm", help="drivers that judge the failures at the middle strength, or none")
    add("--all-strengths", action="store_true", help="search at every strength, instead of bisecting")
    add(
        "--minutes",
        type=float,
        default=math.inf,
        help="no search begins after this time; unfinished faults are left out",
    )
    add("--jobs", type=int, default=os.cpu_count() or 1, help="processes")
    add(
        "--out",
        type=Path,
        default=Path("out/faults"),
        help="the folder for results; results that it already contains are not computed again",
    )
    add(
        "--causes",
        action="store_true",
        help="instead, diagnose failures of the faults and count how often the right part is named",
    )
    add(
        "--judgement",
        action="store_true",
        help="instead, judge failures with and without a fault and count how often the judgement is right",
    )
    add("--strength", type=float, default=1.0, help="with --causes: strength of the faults")
    add("--failures", type=int, default=5, help="with --causes: maximum number of failures of each fault")
    add("--list", action="store_true", help="print the kinds of fault as a table, and do nothing else")
    return parser


if __name__ == "__main__":
    sys.exit(main())

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
from types import MappingProxyType
from typing import Any

from foresee_dsl.files import write_whole
from foresee_study.faults.benchmark import Plan, all_kinds, measure
from foresee_study.faults.causes import causes_table, measure_causes
from foresee_study.faults.judgement import judgement_table, measure_judgement
from foresee_study.faults.plug_in_path import add_plug_in
from foresee_study.faults.sampling import library
from foresee_study.faults.searching import APPROACHES, DEFAULT_APPROACHES
from foresee_study.faults.table import Benchmark, as_json, as_markdown, table_lines
from foresee_study.halves import Half

FEW = (
    "pdm/late_objects", "pdm/blind_to_walkers", "pdm/forgets_hidden", "pdm/weak_brakes", "pdm/overtrusts_signals",
    "pdm/small_gap_left",
)  # fmt: skip
"""The faults that `make faults` seeds by default."""


def main(words: Sequence[str] | None = None) -> int:
    """Run the benchmark, print its tables, and write `faults.md` and `faults.json`."""
    add_plug_in()
    from foresee_faults.catalogue import KINDS  # type: ignore[import-not-found, unused-ignore]

    args = _parser().parse_args(words)
    if args.list:
        sys.stdout.write(listed(KINDS) + "\n")
        return 0
    faults = {"all": all_kinds(KINDS), "few": FEW}.get(args.faults) or _named(args.faults.split(","))
    strengths = tuple(float(text) for text in args.strengths.split(","))
    half, ends_s = Half(args.half), time.time() + 60 * args.minutes
    if args.causes:
        named = measure_causes(
            faults, {name: kind.part for name, kind in KINDS.items()}, half=half, strength=args.strength,
            cases=args.cases, failures=args.failures, ends_s=ends_s, jobs=args.jobs, say=_say,
        )  # fmt: skip
        table = _written(args.out, "causes", causes_table(named) + "\n", [vars(each) for each in named])
    elif args.judgement:
        failures = measure_judgement(library(half), faults, strengths, out=args.out, jobs=args.jobs, ends_s=ends_s,
                                     say=_say)  # fmt: skip
        table = _written(args.out, "judgement", judgement_table(failures) + "\n", [vars(each) for each in failures])
    else:
        plan = Plan(
            faults=faults,
            strengths=tuple(sorted(strengths)),
            approaches=tuple(APPROACHES[each] for each in _chosen(args.approaches.split(","))),
            half=half,
            cases=args.cases,
            simulated_s=args.seconds_simulated,
            judges=tuple(each for each in args.judges.split(",") if each not in ("", "none")),
            jobs=args.jobs,
            out=args.out,
            bisects=not args.all_strengths,
            ends_s=ends_s,
        )

        def write(benchmark: Benchmark) -> None:
            _written(args.out, "faults", as_markdown(benchmark), as_json(benchmark))

        table = as_markdown(measure(plan, _say, write))
    sys.stdout.write(table)
    return 0


def _say(line: str) -> None:
    print(line, file=sys.stderr, flush=True)  # noqa: T201


def _written(out: Path, name: str, table: str, data: object) -> str:
    """Write a table as Markdown, and its data as JSON; return the table."""
    write_whole(out / f"{name}.md", table)
    write_whole(out / f"{name}.json", json.dumps(data, indent=1) + "\n")
    return table


def listed(kinds: Mapping[str, Any]) -> str:
    """Return the kinds of fault as the Markdown table in `docs/background/faults.md`."""
    rows = ((f"`{name}`", k.what, k.cause, k.scale, k.source) for name, k in kinds.items())
    return "\n".join(table_lines(("kind", "what the driver does", "cause", "strength from 0 to 1", "source"), rows))


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


OPTIONS: Mapping[str, Mapping[str, Any]] = MappingProxyType({
    "--faults": {
        "default": "few",
        "help": "`all`, `few` (six of `pdm`), or names separated by commas: `pdm/late_objects,idm/runs_amber`",
    },
    "--strengths": {
        "default": "0.1,0.2,0.4,0.7,1",
        "help": "strengths of the fault; bisection begins in the middle, and approaches are compared at the middle "
        "strength",
    },
    "--approaches": {"default": ",".join(DEFAULT_APPROACHES), "help": f"the searches, of {', '.join(APPROACHES)}"},
    "--half": {
        "default": "even",
        "choices": tuple(map(str, Half)),
        "help": "test cases whose name's hash is even (`even`), odd (`odd`), or all of them (`all`)",
    },
    "--cases": {"type": int, "default": 5, "help": "number of test cases per fault"},
    "--seconds-simulated": {"type": float, "default": 600.0, "help": "simulated time of each search, s"},
    "--judges": {
        "default": "idm,frenetix,pdm",
        "help": "drivers that drive the failures at the middle strength beside the healthy driver, which is never "
        "among them; or `none`",
    },
    "--all-strengths": {"action": "store_true", "help": "search at every strength, instead of bisecting"},
    "--minutes": {
        "type": float,
        "default": math.inf,
        "help": "no search begins later than this; a fault whose approaches are not all complete is left out of the "
        "tables, and the same command continues with it",
    },
    "--jobs": {"type": int, "default": os.cpu_count() or 1, "help": "number of processes"},
    "--out": {
        "type": Path,
        "default": Path("out/faults"),
        "help": "folder for `faults.md`, `faults.json`, and every completed search. The tables are written after each "
        "fault, and no search is repeated while code and settings are the same",
    },
    "--causes": {
        "action": "store_true",
        "help": "instead, diagnose failures of the faults and count how often the right part is named",
    },
    "--judgement": {
        "action": "store_true",
        "help": "instead, judge failures with and without a fault and count how often the judgement is right",
    },
    "--strength": {"type": float, "default": 1.0, "help": "with `--causes`: strength of the faults"},
    "--failures": {"type": int, "default": 5, "help": "with `--causes`: maximum number of failures of each fault"},
    "--list": {"action": "store_true", "help": "print the kinds of fault as a table, and do nothing else"},
})  # fmt: skip
"""The options by flag, as `argparse` takes them; `docs/background/faults.md` has them as a table."""


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m foresee_study.faults", description=__doc__)
    for flag, option in OPTIONS.items():
        parser.add_argument(flag, **option)
    return parser


if __name__ == "__main__":
    sys.exit(main())

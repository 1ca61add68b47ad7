"""Commands that show what a scenario stands for: `compile` (SUMO files), `expand` (the full text) and `sample` (its
cases)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from foresee_dsl.cli.completion import case_addresses
from foresee_dsl.cli.options.common import AllowOutsideOption, JsonOption, OutOption, json_document, print_json
from foresee_dsl.cli.options.output import format_option, report_results
from foresee_dsl.report.formats import CommandReport
from foresee_dsl.report.safe_text import COLUMNS

if TYPE_CHECKING:
    from foresee_dsl.language.model import Case, Scenario
    from foresee_dsl.language.sampling import Coverage


def compile_(
    address: Annotated[
        str, typer.Argument(metavar="FILE[::CASE]", help="Address of the test case.", autocompletion=case_addresses)
    ],
    out: OutOption = Path("compiled"),
    json: JsonOption = False,
    allow_outside: AllowOutsideOption = False,
) -> None:
    """Write a test case as SUMO files: network, types, routes, configuration (open it with sumo-gui).

    [dim]foresee compile scenarios/scenario7.foresee::r01 --out town[/dim]
    """
    from foresee_dsl.compile import compile_test_case
    from foresee_dsl.compile.sumo_files import write_sumo_folder
    from foresee_dsl.language.project.loading import load_test_case

    bundle = compile_test_case(load_test_case(address, allow_outside=allow_outside))
    files = write_sumo_folder(bundle, out)
    if json:
        print_json({"test_case": address, "key": bundle.key, "files": files})
    else:
        for file in files:
            typer.echo(str(file))
        for note in bundle.scene.notes:
            typer.echo(f"note: {note}", err=True)


def expand(
    address: Annotated[
        str,
        typer.Argument(metavar="FILE[::CASE]", help="A clip, a mutant, or a test case.", autocompletion=case_addresses),
    ],
    allow_outside: AllowOutsideOption = False,
) -> None:
    """Print a clip, a mutant or a test case as one complete scenario, with everything of its parents in it.

    The text of a clip or mutant has other sensor errors than the file itself, so it may end in another way.

    [dim]foresee expand out/children/scenario7/red_light_runner_r02_p1_m3.foresee[/dim]
    """
    from foresee_dsl.editor.highlight import show
    from foresee_dsl.language.project.expand import expanded_text
    from foresee_dsl.language.project.loading import load_test_case

    show(expanded_text(load_test_case(address, allow_outside=allow_outside)))


# ---- sample ---------------------------------------------------------------------------------------------------------

DEFAULT_COUNT = 20
"""Number of cases without `--count` (ours: they fit on a screen together with their coverage)."""


def sample(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A scenario with parameters.")],
    count: Annotated[int | None, typer.Option("--count", min=1, max=10_000, help="Number of cases to draw.")] = None,
    seed: Annotated[int | None, typer.Option("--seed", min=0, max=10**9, help="Seed of the draw.")] = None,
    format_: Annotated[
        str,
        format_option(
            "table: for people; json: for tools; cases: lines to paste into the scenario.", "table", "json", "cases"
        ),
    ] = "table",
    allow_outside: AllowOutsideOption = False,
) -> None:
    """Draw cases of a scenario, or list the cases that it has, with their coverage of the parameters' ranges.

    The same file, count and seed give the same cases on every machine.
    Without --count and --seed the scenario's own cases are listed, including those of `cases ... from seed`.

    [dim]foresee sample my.foresee
    foresee sample my.foresee --count 50 --seed 7 --format cases[/dim]
    """
    from foresee_dsl.language.project.loading import Project
    from foresee_dsl.language.sampling import coverage

    scenario = Project(allow_outside=allow_outside).whole_scenario(file)
    cases = _cases(scenario, count, seed)
    covered = coverage(scenario, cases)
    report_results(
        format_,
        CommandReport(
            "sample", lambda: _document(file, scenario, cases, covered), forms={"cases": lambda: _lines(cases)}
        ),
        people=lambda _: _print_table(scenario, cases, covered),
    )


def _lines(cases: Sequence[Case]) -> str:
    from foresee_dsl.language.printer import print_item

    return "".join(f"  {print_item(case)}\n" for case in cases)


def _cases(scenario: Scenario, count: int | None, seed: int | None) -> Sequence[Case]:
    from foresee_dsl.errors import ForeseeError
    from foresee_dsl.language import model as m
    from foresee_dsl.language.sampling import TooFewError, axis_of, draw

    written = scenario.all(m.Case)
    if count is None and seed is None and written:
        return written
    if not any(axis_of(param) for param in scenario.all(m.Param)):
        raise ForeseeError(
            f"scenario '{scenario.name}' has no parameter with a range or options, so no case can be drawn"
        )
    wanted = m.Cases.model_validate(
        {"count": {"value": count or DEFAULT_COUNT, "unit": ""}, "seed": {"value": seed or 0, "unit": ""}}
    )
    try:
        return draw(scenario, wanted)
    except TooFewError as error:
        raise ForeseeError(str(error)) from None


def _document(file: Path, scenario: Scenario, cases: Sequence[Case], covered: Coverage) -> str:
    from foresee_dsl.language.arithmetic.cases import case_values
    from foresee_dsl.language.printer import value_text

    return json_document(
        {
            "file": str(file),
            "scenario": scenario.name,
            "cases": [
                {"name": case.name, "values": {n: value_text(v) for n, v in case_values(scenario, case).items()}}
                for case in cases
            ],
            "distinct": covered.distinct,
            "parameters": [
                {"name": r.name, "smallest": value_text(r.smallest), "largest": value_text(r.largest),
                 "reached": r.reached, "bins": r.bins, "of": r.of}
                for r in covered.reaches
            ],
            "pairs": {"reached": covered.pairs_reached, "of": covered.pairs},
        }
    )  # fmt: skip


def _print_table(scenario: Scenario, cases: Sequence[Case], covered: Coverage) -> None:
    from foresee_dsl.language.arithmetic.cases import case_values
    from foresee_dsl.language.model import Param
    from foresee_dsl.language.printer import value_text

    names = [param.name for param in scenario.all(Param)]
    rows = [[case.name, *(value_text(case_values(scenario, case)[name]) for name in names)] for case in cases]
    for block in _blocks(["case", *names], rows):
        typer.echo("\n".join(block) + "\n")
    for reach in covered.reaches:
        values = f"{value_text(reach.smallest)} to {value_text(reach.largest)}, " if reach.of != "options" else ""
        share = f"{reach.reached} of {reach.bins} {reach.of} ({reach.reached / reach.bins:.0%})"
        typer.echo(f"{reach.name}: {values}{share}")
    if covered.pairs:
        part = covered.pairs_reached / covered.pairs
        typer.echo(f"pairs of values: {covered.pairs_reached} of {covered.pairs} occur together ({part:.0%})")
    if covered.distinct < covered.cases:
        again = covered.cases - covered.distinct
        verb = "repeats" if again == 1 else "repeat"
        typer.echo(f"note: {again} of {covered.cases} cases {verb} the values of another")


def _blocks(head: list[str], rows: list[list[str]]) -> Sequence[list[str]]:
    """Return the lines of a table, split into blocks below each other if it is wider than a screen."""
    widths = [max(len(row[k]) for row in (head, *rows)) for k in range(len(head))]
    blocks: list[list[int]] = [[]]
    used = widths[0]
    for k in range(1, len(head)):
        if blocks[-1] and used + 2 + widths[k] > COLUMNS:
            blocks.append([])
            used = widths[0]
        blocks[-1].append(k)
        used += 2 + widths[k]
    return [
        ["  ".join(row[k].ljust(widths[k]) for k in (0, *columns)).rstrip() for row in (head, *rows)]
        for columns in blocks
    ]

"""The tables of rq4: failing test cases that DriveFuzz and the forecast add, over two iterations."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from foresee_study.complementing import Split, split
from foresee_study.fuzzed import Fuzzed
from foresee_study.measured import MeasuredCampaign
from foresee_study.results import Results, mean
from foresee_study.tables.table import Column, Row, Table, Value, family_rows, section


@dataclass(frozen=True)
class Iteration:
    """One iteration of one repetition: the runs of both techniques, and the failing test cases of each."""

    fuzzing: Fuzzed
    forecast: MeasuredCampaign
    split: Split

    @property
    def forecast_on_rest(self) -> MeasuredCampaign:
        """Return the forecast on the test cases in which DriveFuzz found no failure."""
        return self.forecast.only(self.split.left | self.split.forecast)

    @property
    def failing_children(self) -> int:
        """Return the number of failing children of these test cases."""
        return sum(child.verdict.is_failure for child in self.forecast_on_rest.children_run)


def iterations(results: Results, driver: str) -> tuple[tuple[Iteration, Iteration], ...]:
    """Return both iterations of each repetition that has both."""
    done = []
    for first in results.of_campaign(driver, "foresee"):
        both = []
        names = [case.name for case in first.usable]
        for number, second in ((1, False), (2, True)):
            campaigns = results.of_campaign(driver, "foresee", second=second)
            forecast = next((m for m in campaigns if m.repetition == first.repetition), None)
            keys = (driver, first.repetition, number)
            fuzzing = next((f for f in results.fuzzings if (f.driver, f.repetition, f.iteration) == keys), None)
            if forecast is None or fuzzing is None:
                break
            both.append(Iteration(fuzzing, forecast, split(names, fuzzing, forecast)))
            names = list(both[-1].split.left)
        if len(both) == 2:
            done.append((both[0], both[1]))
    return tuple(done)


def complementarity(results: Results) -> tuple[Table, ...]:
    """Return the tables of rq4."""
    return (_added(results), _costs(results))


def _added(results: Results) -> Table:
    columns = (
        Column("#F", ("Plain",)),
        *(
            Column(title, (f"Iteration {k}", who), digits)
            for k in (1, 2)
            for title, who, digits in (("+#F", "DriveFuzz", 2), ("+#F", "foresee", 2), ("#F", "Σ", 2), ("+%", "Σ", 2))
        ),
        Column("of DriveFuzz's, %", ("foresee",)),
    )
    rows: list[Row] = []
    for driver in results.drivers:
        done = iterations(results, driver)
        lines = [tuple(_numbers(done, family)) for family in results.families]
        rows += family_rows(driver, results.families, lines, _with_shares)
    notes = (
        "#F: failing test cases, each counted once. Plain: unmutated. In each iteration DriveFuzz comes first; foresee "
        "(clips of 10 s, n_rp = 4) searches the test cases in which DriveFuzz found no failure. +%: compared with "
        "plain. All numbers are means of the repetitions.",
    )
    title = "RQ4: DriveFuzz, and foresee on the test cases in which it found no failure"
    return Table("rq4", title, columns, tuple(rows), notes=notes)


def _numbers(done: tuple[tuple[Iteration, Iteration], ...], family: str) -> Iterator[float | None]:
    """Yield how many test cases of a family fail unmutated, and how many each technique makes fail in each
    iteration.
    """
    firsts = [first.forecast for first, _ in done]
    names = frozenset(case.name for m in firsts for case in m.cases if case.family == family)
    yield mean(sum(case.verdict.is_failure for case in m.cases if case.family == family) for m in firsts)
    for k in (0, 1):
        yield mean(len(both[k].split.fuzzed & names) for both in done)
        yield mean(len(both[k].split.forecast & names) for both in done)


def _with_shares(line: tuple[float | None, ...]) -> tuple[Value, ...]:
    plain, *added = (value or 0.0 for value in line)
    values: list[Value] = [plain]
    sum_so_far = plain
    for fuzzed, forecast in zip(added[::2], added[1::2], strict=True):
        sum_so_far += fuzzed + forecast
        values += [fuzzed, forecast, sum_so_far, 100 * (sum_so_far / plain - 1) if plain else None]
    by_fuzzing, by_forecast = sum(added[::2]), sum(added[1::2])
    return (*values, 100 * by_forecast / by_fuzzing if by_fuzzing else None)


def _costs(results: Results) -> Table:
    """Return the table of what each technique cost: runs, simulated hours, and failing test cases per hour."""
    columns: tuple[Column, ...] = tuple(
        Column(title, (who,), digits)
        for who in ("DriveFuzz", "foresee")
        for title, digits in (("runs", 0), ("simulated hours", 2), ("failing test cases", 2), ("an hour", 1))
    )
    columns += (Column("failing children", ("foresee",)),)
    rows: list[Row] = []
    for driver in results.drivers:
        done = iterations(results, driver)
        lines = [Row(f"Iteration {k + 1}", tuple(_cost([both[k] for both in done]))) for k in (0, 1) if done]
        rows += section(driver, lines)
    note = "For foresee, clips and children of the test cases that it searched are counted. Means of the repetitions."
    return Table("rq4_costs", "RQ4: cost of both techniques", columns, tuple(rows), notes=(note,))


def _cost(repetitions: list[Iteration]) -> Iterator[Value]:
    forecasts = [iteration.forecast_on_rest for iteration in repetitions]
    sides = (
        ([sum(s.runs for s in iteration.fuzzing.seeds) for iteration in repetitions],
         [sum(s.simulated_s for s in iteration.fuzzing.seeds) for iteration in repetitions],
         [len(iteration.split.fuzzed) for iteration in repetitions]),
        ([m.clips + len(m.children_run) for m in forecasts], [m.simulated_s for m in forecasts],
         [len(iteration.split.forecast) for iteration in repetitions]),
    )  # fmt: skip
    for runs, seconds, failing in sides:
        hours = sum(seconds) / 3600
        yield mean(runs)
        yield hours / len(repetitions)
        yield mean(failing)
        yield sum(failing) / hours if hours else None
    yield mean(iteration.failing_children for iteration in repetitions)

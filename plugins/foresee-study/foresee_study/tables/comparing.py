"""Tables of comparisons: ratio with interval, effect sizes, p values with Holm's correction."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from foresee_study.statistics import NotTested, PairedComparison
from foresee_study.statistics.effects import a12_size, holm
from foresee_study.tables.table import Column, Row, RowKind, Table, Value

COLUMNS = (
    Column("first"), Column("second"), Column("change, %", digits=1), Column("ratio"), Column("low", ("95 %",)),
    Column("high", ("95 %",)), Column("A12"), Column("size"), Column("d"), Column("p, signed rank", digits=4),
    Column("Holm", digits=4), Column("p, permutation", digits=4), Column("Holm", ("permutation",), digits=4),
    Column("units"), Column("test cases"),
)  # fmt: skip
NOTES = (
    "Units are (test case, repetition); findings are counted in each unit, so that a story that occurs in two test "
    "cases counts twice. The interval of the ratio is by bootstrap over test cases and repetitions. The signed-rank "
    "test treats each unit as independent; the permutation test flips the signs of whole test cases, exactly. Holm's "
    "correction is over this table.",
)


@dataclass(frozen=True)
class Compared:
    """Two techniques whose comparison is a row of a table.

    `heading`: the heading above the row; it is shown if it differs from that of the row before.
    """

    heading: str
    label: str
    comparison: PairedComparison


def comparison_table(name: str, title: str, compared: Sequence[Compared]) -> Table:
    """Return comparisons as a table; all p values in it are corrected together."""
    ranks = _corrected([pair.comparison.signed_rank for pair in compared])
    flips = _corrected([pair.comparison.flips for pair in compared])
    rows: list[Row] = []
    untested: Counter[str] = Counter()
    heading = None
    for pair, by_rank, by_flips in zip(compared, ranks, flips, strict=True):
        if pair.heading != heading:
            rows.append(Row(pair.heading, kind=RowKind.HEADING))
        heading, comparison = pair.heading, pair.comparison
        if isinstance(comparison.signed_rank, NotTested):
            untested[comparison.signed_rank.reason] += 1
        rows.append(
            Row(pair.label, (
                comparison.first, comparison.second, comparison.change_percent, comparison.ratio, *comparison.interval,
                comparison.a12, a12_size(comparison.a12), comparison.d, _p(comparison.signed_rank), by_rank,
                _p(comparison.flips), by_flips, comparison.pairs, comparison.cases,
            ))
        )  # fmt: skip
    notes = (f"Not tested ({count} of {len(compared)} rows): {reason}." for reason, count in untested.items())
    return Table(name, title, COLUMNS, tuple(rows), notes=(*NOTES, *notes))


def _p(value: float | NotTested) -> Value:
    return None if isinstance(value, NotTested) else value


def _corrected(values: Sequence[float | NotTested]) -> list[Value]:
    tested = iter(holm([value for value in values if not isinstance(value, NotTested)]))
    return [None if isinstance(value, NotTested) else next(tested) for value in values]

"""Tables of comparisons: ratio with interval, effect sizes, p values with Holm's correction."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from foresee_study.statistics import Comparison, NotTested
from foresee_study.statistics.effects import a12_size, holm
from foresee_study.tables.table import Column, Row, RowKind, Table, Value

COLUMNS = (
    Column("first"), Column("second"), Column("change, %", digits=1), Column("ratio"), Column("low", ("95 %",)),
    Column("high", ("95 %",)), Column("A12"), Column("size"), Column("d"), Column("p, signed rank", digits=4),
    Column("Holm", digits=4), Column("p, permutation", digits=4), Column("Holm", ("permutation",), digits=4),
    Column("units"), Column("test cases"),
)  # fmt: skip
NOTES = (
    "Units are (test case, repetition); findings are counted in each of them, so that a story that two test cases tell "
    "counts twice. The interval of the ratio is by bootstrap over test cases. The signed-rank "
    "test takes each unit as one; the permutation test flips the signs of whole test cases, exactly. Holm's correction "
    "is over this table.",
)


@dataclass(frozen=True)
class Compared:
    """Two techniques whose comparison becomes a row. `heading`: what stands above the row, where that changes."""

    heading: str
    label: str
    found: Comparison


def comparison_table(name: str, title: str, compared: Sequence[Compared]) -> Table:
    """Return comparisons as a table; p values that there are get corrected together."""
    ranks = _corrected([one.found.signed_rank for one in compared])
    flips = _corrected([one.found.flips for one in compared])
    rows: list[Row] = []
    untested: Counter[str] = Counter()
    heading = None
    for one, by_rank, by_flips in zip(compared, ranks, flips, strict=True):
        if one.heading != heading:
            rows.append(Row(one.heading, kind=RowKind.HEADING))
        heading, found = one.heading, one.found
        if isinstance(found.signed_rank, NotTested):
            untested[found.signed_rank.reason] += 1
        rows.append(
            Row(one.label, (
                found.first, found.second, found.change_percent, found.ratio, *found.interval, found.a12,
                a12_size(found.a12), found.d, _p(found.signed_rank), by_rank, _p(found.flips), by_flips, found.pairs,
                found.cases,
            ))
        )  # fmt: skip
    notes = (f"Not tested ({count} of {len(compared)} rows): {reason}." for reason, count in untested.items())
    return Table(name, title, COLUMNS, tuple(rows), notes=(*NOTES, *notes))


def _p(value: float | NotTested) -> Value:
    return None if isinstance(value, NotTested) else value


def _corrected(values: Sequence[float | NotTested]) -> list[Value]:
    tested = iter(holm([value for value in values if not isinstance(value, NotTested)]))
    return [None if isinstance(value, NotTested) else next(tested) for value in values]

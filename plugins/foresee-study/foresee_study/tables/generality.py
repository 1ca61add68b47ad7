"""rq5: other towns, and heavy weather without other mutations."""

from __future__ import annotations

from collections.abc import Iterator

from foresee_dsl.simulate.results.verdict import COLLISIONS, Verdict
from foresee_study.measured import Counted, MeasuredCampaign
from foresee_study.questions import HEAVY_WEATHER
from foresee_study.results import Results, mean, total
from foresee_study.settings import BUNDLED
from foresee_study.tables.table import Column, Row, RowKind, Table, Value, section

_COUNTED = (*COLLISIONS, Verdict.STUCK)
"""The failures that a study counts: it does not judge traffic rules."""
_COLUMNS = (
    Column("#TCs"), *(Column(kind.value) for kind in _COUNTED), Column("Σ"), Column("findings"), Column("avoidable"),
    Column("collisions, %", digits=1),
)  # fmt: skip


def generality(results: Results) -> tuple[Table, ...]:
    """Return the tables of rq5."""
    return (_towns(results), _weather(results))


def _towns(results: Results) -> Table:
    rows: list[Row] = []
    for group in (BUNDLED, *results.towns):
        lines = [
            Row(driver, tuple(_counts(campaigns)))
            for driver in results.drivers
            if (campaigns := results.of_campaign(driver, "foresee", group=group))
        ]
        rows += section(group, lines)
    notes = (
        "foresee, clips of 10 s, n_rp = 4. #TCs: children that were run; Σ also counts stuck, as the paper does here; "
        "collisions, %: of the children. Means of the repetitions.",
    )
    return Table("rq5", "RQ5: towns and drivers", _COLUMNS, tuple(rows), "town", notes)


def _weather(results: Results) -> Table:
    rows = [
        Row(driver, tuple(_counts(campaigns)))
        for driver in results.drivers
        if (campaigns := results.of_campaign(driver, "foresee", preset=HEAVY_WEATHER))
    ]
    if len(rows) > 1:
        sums: list[Value] = [total(_number(row.values[k]) for row in rows) for k in range(len(_COLUMNS) - 1)]
        children, collided = (_number(sums[0]), total(_number(value) for value in sums[1 : 1 + len(COLLISIONS)]))
        share = 100 * collided / children if children and collided is not None else None
        rows.append(Row("Σ", (*sums, share), RowKind.SUM))
    notes = (
        "Each of foresee's clips was run again in heavy weather, with nothing else changed. #TCs: clips that passed in "
        "their own weather.",
    )
    return Table("rq5_weather", "RQ5: heavy weather", _COLUMNS, tuple(rows), "driver", notes)


def _number(value: Value) -> float | None:
    return None if value is None or isinstance(value, str) else float(value)


def _counts(campaigns: tuple[MeasuredCampaign, ...]) -> Iterator[Value]:
    children = mean(len(m.children_run) for m in campaigns)
    collided = mean(m.count(Counted.COLLISIONS) for m in campaigns)
    yield children
    yield from (mean(m.of_verdict(kind) for m in campaigns) for kind in _COUNTED)
    yield mean(sum(m.of_verdict(kind) for kind in _COUNTED) for m in campaigns)
    yield mean(m.count(Counted.FINDINGS) for m in campaigns)
    yield mean(m.count(Counted.AVOIDABLE) for m in campaigns)
    yield 100 * collided / children if children and collided is not None else None

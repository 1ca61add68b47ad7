"""How sure a failure is, as text of at most 80 columns: the share of seeds, the boundary, the map and the region."""

from __future__ import annotations

from collections.abc import Iterator

from foresee_dsl.campaign.findings.sureness import HeatMap, Sureness
from foresee_dsl.report.terminal.review import wrapped

_MARKS = {True: "#", False: ".", None: " "}
"""Characters of the map: a run that fails, one that passes, and values that are not possible."""


def sureness_text(sure: Sureness) -> str:
    """Return how sure a failure is as text."""
    return "\n".join(_lines(sure)) + "\n"


def _lines(sure: Sureness) -> Iterator[str]:
    number = f"{sure.number}. " if sure.number else ""
    yield from wrapped(f"{number}{sure.name} with {sure.driver}: {sure.failed} of {sure.seeds} sensor seeds fail")
    if sure.note:
        yield from wrapped(sure.note, "  ")
    if sure.edges:
        yield from ("", "Boundary")
        for edge in sure.edges:
            yield from wrapped(edge.text, "  ", more="  ")
    if sure.map is not None:
        yield from ("", *map_lines(sure.map))
    region = sure.region
    if region is not None:
        yield from ("", f"Failing region: {region.failed} of {region.drawn} cases drawn inside it fail")
        yield from (f"  {line}" for line in (*region.parameters, region.require))
        yield from map(str, region.files)


def map_lines(heat_map: HeatMap) -> Iterator[str]:
    """Yield the map as characters, with the values at its sides."""
    yield f"{heat_map.across} across, {heat_map.down} down (# fails, . passes)"
    left = max(map(len, heat_map.rows))
    for name, row in zip(heat_map.rows, heat_map.fails, strict=True):
        yield f"  {name:>{left}}  " + " ".join(_MARKS[fails] * 2 for fails in row)
    first, last = heat_map.columns[0], heat_map.columns[-1]
    room = 3 * len(heat_map.columns) - 1 - len(first)
    yield f"  {'':>{left}}  {first}{last:>{max(room, len(last) + 1)}}"

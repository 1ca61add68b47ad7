"""Limits on the memory, time and size that one input may take: each with its name, default and the way to raise it.

A file from another person may be built to fill a machine's memory. So everything that is started or loaded has a limit
above the needs of real scenarios and maps; an error message names the limit, and `foresee --limit NAME=NUMBER` raises
it.
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from types import MappingProxyType

from foresee_dsl.errors import ForeseeError

VARIABLE = "FORESEE_LIMITS"
"""The environment variable that holds limits other than the defaults: `cases=50000 trace=2000`."""


class LimitError(ForeseeError):
    """Raised for a limit with an unknown name, or with a value that is not a number above 0."""


@dataclass(frozen=True)
class ResourceLimit:
    """A limit: `default` is its default in `unit`; `what` says in the documentation what is limited."""

    name: str
    default: float
    unit: str
    what: str


LIMITS = MappingProxyType(
    {
        limit.name: limit
        for limit in (
            # netconvert 1.28 with one thread starts with 200 MB of data and needs 65 MB of real memory for each CARLA
            # town and 70 MB for a map of 3 MB from OpenStreetMap; a road of 100,000 km in a file of 1 kB takes all
            # memory.
            ResourceLimit(
                "netconvert-memory",
                450,
                "MB",
                "memory of netconvert, or of SUMO while it loads a map, plus as much for each 5 MB of the map (Linux)",
            ),
            # A CARLA town takes 0.2 to 3 s on a slow core; a run of a minute hangs.
            ResourceLimit(
                "netconvert-time", 60, "s", "wall time of one start of netconvert, or of SUMO that loads a map"
            ),
            # An OpenStreetMap extract of a town centre has 5 to 30 MB, the largest known CARLA town 4 MB, a network of
            # a city about 50 MB; the parsed tree of such a file takes ten times its size in memory.
            ResourceLimit(
                "file", 100, "MB", "size of a map, a network or another file that is read, also after unpacking"
            ),
            # Ours, not measured: ten times the limit of a map, since this tool writes these files.
            ResourceLimit("results", 1000, "MB", "size of the JSON of a campaign, a study or a fuzzing run"),
            # Ours, not measured: ten times the largest file of the language, which a clip's record contains as text.
            ResourceLimit("record", 20, "MB", "unpacked size of one result in a store"),
            # The trace of a run of a minute with 40 actors has 3 MB of arrays; that of an hour with 20 actors has 100
            # MB.
            ResourceLimit("trace", 400, "MB", "unpacked size of a trace"),
            # Reading 9.5 million samples took 0.8 GB; a recording of the data sets that are read has some hundred
            # thousand to some million.
            ResourceLimit(
                "recording", 10_000_000, "samples", "samples that are kept of a recording; an actor counts as ten"
            ),
            # Two texts of 2 MB with the same 280,000 lines in another order took 26 s and 170 MB.
            ResourceLimit("difference", 1, "MB", "size of a text that `git-diff` compares line by line"),
            # The largest bundled scenario has 100 cases; a case takes 2 kB.
            ResourceLimit("cases", 20_000, "cases", "sampled cases in all files of one command"),
            # The bundled town has 60 items; 2,000 items take a second to read and need 60 MB. Larger ones are maps,
            # which are imported.
            ResourceLimit("network", 2000, "items", "junctions, roads and buildings of a network in the language"),
            # The longest condition of the bundled scenarios has four parts; a file of 2,000 takes half a second.
            ResourceLimit("conditions", 2000, "words", "`and`, `or` and `not` in one file"),
        )
    }
)
"""All limits by name. The defaults are ours, each with its measurement."""


def most(name: str) -> float:
    """Return the value of a limit, in its unit: from FORESEE_LIMITS, otherwise its default.

    Raises:
        LimitError: FORESEE_LIMITS has an unknown name or a value that is not a number above 0.
    """
    return _raised_limits().get(name, LIMITS[name].default)


def raised_by(name: str, needed: float | None = None) -> str:
    """Return how to raise a limit: `foresee --limit cases=500000 COMMAND allows it`.

    Args:
        name: the limit. needed: the value that would suffice, in its unit; None: twice the present limit.
    """
    enough = 2 * most(name) if needed is None else needed
    return f"`foresee --limit {name}={math.ceil(enough):d} COMMAND` allows it"


def allow(settings: list[str]) -> None:
    """Set limits, each as `NAME=NUMBER`, for this process and its child processes.

    Raises:
        LimitError: a name is unknown, or a value is not a number above 0.
    """
    if settings:
        os.environ[VARIABLE] = " ".join([*os.environ.get(VARIABLE, "").split(), *settings])
        _raised_limits()


def _raised_limits() -> dict[str, float]:
    limits = {}
    for word in os.environ.get(VARIABLE, "").split():
        name, _, number = word.partition("=")
        if name not in LIMITS:
            raise LimitError(f"there is no limit {name!r}; there are {', '.join(LIMITS)}")
        try:
            value = float(number)
        except ValueError:
            value = math.nan
        if not 0 < value < math.inf:
            raise LimitError(f"the limit {word!r} is not a number above 0: write {name}={LIMITS[name].default:g}")
        limits[name] = value
    return limits

"""Records of how sure a failure is (`foresee sure`), and the file beside the campaign that keeps them."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path

from pydantic import TypeAdapter, ValidationError

from foresee_dsl.documents import every_field, or_null
from foresee_dsl.errors import ForeseeError
from foresee_dsl.files import read_outside, write_whole

FILE = "sure.json"
"""Name of the file in a campaign's folder that says how sure its findings are, by name."""
SEEDS = 20
"""Number of sensor seeds. The share of them that fail is then known within 0.22 (half the width of the 95 % confidence
interval of a share of one half).
"""
SIDE = 9
"""Number of values along each side of the map. Ours: the failing value in the middle, four values from the unmutated
one up to it, and as many beyond it.
"""


SEED = "seed"
"""The side of a map that has sensor seeds instead of the values of a change."""


@dataclass(frozen=True)
class Edge:
    """The values at which one changed value begins to pass while the other changes stay as they are.

    Attributes:
        change: actor and property, such as `walker.timing`. unit: unit of the values; "" for a ratio.
        was, fails: the unmutated value, and the value of the finding. passes: the passing value nearest to `fails` on
          the side of `was`; None if `was` fails too. beyond: the passing value nearest to `fails` on the other side;
          None if none was found.
        runs: number of runs in which these values were found.
    """

    change: str
    unit: str
    was: float
    fails: float
    passes: float | None
    beyond: float | None
    runs: int

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {**every_field(self), "distance": self.distance}

    @property
    def distance(self) -> float | None:
        """By how much the failing value must change at least for the run to pass; None if every tried value fails."""
        far = [round(abs(value - self.fails), 6) for value in (self.passes, self.beyond) if value is not None]
        return min(far, default=None)

    @property
    def text(self) -> str:
        """The value at which the run fails, and the nearby values at which it passes, in words."""
        unit = f" {self.unit}" if self.unit else ""
        sides = [
            f"{value:.2f}{unit} ({abs(value - self.fails):.2f}{unit} {where})"
            for value, where in ((self.passes, "nearer to the unmutated value"), (self.beyond, "beyond"))
            if value is not None
        ]
        passes = f"passes at {' and at '.join(sides)}" if sides else "passes nowhere that was tried"
        return f"{self.change} fails at {self.fails:.2f}{unit}; {passes}; unmutated {self.was:.2f}{unit}"

    @property
    def share(self) -> float:
        """The `distance` as a share of the mutation's own change of the value."""
        distance = self.distance
        return distance / abs(self.fails - self.was) if distance is not None else float("inf")


@dataclass(frozen=True)
class HeatMap:
    """Which runs of a grid fail, by two changed values, or by one and the sensor seed.

    Attributes:
        across, down: the changes (or `SEED`). columns, rows: their values as text.
        fails: whether the run fails, by row and column; None where the values are not possible.
        unmutated: the unmutated value of each change, as text.
    """

    across: str
    down: str
    columns: tuple[str, ...]
    rows: tuple[str, ...]
    fails: tuple[tuple[bool | None, ...], ...]
    unmutated: tuple[str, ...]

    @property
    def own(self) -> tuple[int, int]:
        """Row and column of the finding itself."""
        return len(self.rows) // 2 if self.down != SEED else 0, len(self.columns) // 2


@dataclass(frozen=True)
class Region:
    """A part of the map in which every run fails.

    Attributes:
        parameters: the `param` lines that declare its values. require: the `require` line that limits them to the
            region.
        drawn, failed: number of cases that the language drew inside it, and how many of them fail.
        files: two written scenarios: the finding's clip, and one that extends it by these lines; empty if they were not
            to be written.
    """

    parameters: tuple[str, ...]
    require: str
    drawn: int
    failed: int
    files: tuple[Path, ...] = ()


@dataclass(frozen=True)
class Sureness:
    """How sure a failure is.

    Attributes:
        name, number: name of the failure, and number of its finding (0 if there is no finding). reason: how its run
            ended. seeds, failed: number of sensor seeds, and of those that fail.
        note: why there is no map or region; "" otherwise.
    """

    name: str
    number: int
    driver: str
    reason: str
    seeds: int
    failed: int
    edges: tuple[Edge, ...] = ()
    map: HeatMap | None = None
    region: Region | None = None
    note: str = ""

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {**every_field(self), "note": or_null(self.note)}


def keep_sureness(campaign: Path, sure: Sureness) -> None:
    """Write how sure a finding is into the file beside its campaign.

    Raises:
        ForeseeError: the file is there and cannot be read. OSError: it cannot be written.
    """
    kept = {**kept_sureness(campaign), sure.name: sure}
    data = {name: asdict(record) for name, record in sorted(kept.items())}
    write_whole(campaign / FILE, json.dumps(data, indent=1, default=str) + "\n")


def kept_sureness(campaign: Path) -> dict[str, Sureness]:
    """Return how sure the findings of a campaign are, by name, as far as that was computed.

    Raises:
        ForeseeError: the file cannot be read.
    """
    file = campaign / FILE
    try:
        return TypeAdapter(dict[str, Sureness]).validate_json(read_outside(file, "results"))
    except FileNotFoundError:
        return {}
    except OSError as err:
        raise ForeseeError(f"{file} cannot be read: {err}") from err
    except (ValidationError, RecursionError) as err:
        raise ForeseeError(f"{file} was not written by `foresee sure`: remove it, and run the command again") from err


def sureness_of(campaign: Path, name: str, reason: str) -> Sureness | None:
    """Return how sure a finding is; None if that was not computed for this run.

    Args:
        reason: how the finding's run ended. What was computed for a run that ended differently is out of date.
    """
    sure = kept_sureness(campaign).get(name)
    return sure if sure is not None and sure.reason == reason else None

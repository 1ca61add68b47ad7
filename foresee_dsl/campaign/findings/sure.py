"""How sure a failure is: over sensor seeds, and over the values that its mutation changed (`foresee sure`)."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from functools import partial
from itertools import combinations
from pathlib import Path
from typing import TypeVar

from foresee_dsl.campaign.driving import DriverSetup, longest_s
from foresee_dsl.campaign.findings.diagnosing import Failing
from foresee_dsl.campaign.findings.sureness import SEED, SEEDS, SIDE, Edge, HeatMap, Region, Sureness
from foresee_dsl.campaign.workers.pool import BrokenTask, Task, WorkerPool
from foresee_dsl.derive.minimise.boundary import NEIGHBOURS, ValueGrid, grid_of
from foresee_dsl.drivers.deadlines import DEADLINES
from foresee_dsl.errors import ForeseeError, InputError
from foresee_dsl.files import absolute, write_whole
from foresee_dsl.language import model as m
from foresee_dsl.language.arithmetic.cases import case_values
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.parser import parse
from foresee_dsl.language.printer import print_item, print_model
from foresee_dsl.language.project.expand import expand_mutant, expanded_model, other_sensor_errors, surroundings
from foresee_dsl.language.project.loading import Project, load_test_case

DRAWN = 5
"""Number of cases that are drawn inside the failing region. Ours: if 5 of 5 fail, at least 55 % of all cases in the
region fail, with 95 % confidence.
"""
_FARTHEST = 64
"""Beyond the failing value, a passing value is looked for up to this distance, in steps of the grid. Ours: for a timing
these are 0.64, more than any operator changes, and seven runs reach it.
"""
Argument = TypeVar("Argument")
Result = TypeVar("Result")
Outcome = bool | None
"""Whether a run fails; None if its values are not possible."""


@dataclass(frozen=True)
class _Subject:
    """What is run: the failure, and the clip of its mutant."""

    case: TestCase
    clip: TestCase | None
    setup: DriverSetup

    def with_seed(self, seed: int) -> _Subject:
        """Return the same with another sensor seed."""
        return replace(self, setup=replace(self.setup, seed=seed))


@dataclass(frozen=True)
class _Variant:
    """A run with other changes or another seed."""

    changes: tuple[m.Change, ...] | None = None
    seed: int | None = None


Progress = Callable[[int, int], None]
"""A function that is called with the number of finished tasks and the number of known tasks."""


def how_sure(
    failing: Failing,
    jobs: int = 1,
    progress: Progress = lambda done, of: None,  # noqa: ARG005
    out: Path | None = None,
) -> Sureness:
    """Return how sure a failure is; the result is the same for any number of processes.

    `out`: folder for the failing region as a scenario.

    Raises:
        ForeseeError: it does not fail any more.
    """
    case = replace(failing.case, document=None)
    clip = None
    if case.mutant is not None:
        clip = replace(load_test_case(str(absolute(case.source.parent / case.mutant.parent))), document=None)
    setup = failing.setup
    runs = _Runs(_Subject(case, clip, setup), jobs, progress)
    seeds = _seeds(setup.seed)
    reasons = runs.reasons(seeds)
    if not reasons[0]:
        raise ForeseeError(f"{failing.name} does not fail with {setup.driver} and seed {setup.seed} any more")
    failed = sum(map(bool, reasons))
    sure = Sureness(failing.name, failing.number, setup.driver, reasons[0], len(seeds), failed)
    grids = [grid for grid in map(grid_of, case.mutant.changes if case.mutant else ()) if grid is not None]
    if not grids:
        return replace(sure, note="the finding changes no number, so there is no boundary, map or region")
    edges = runs.edges(grids)
    # The changes whose boundary is nearest, compared with the mutation itself, matter most.
    chosen = sorted(sorted(range(len(grids)), key=lambda k: (edges[k].share, k))[:2])
    heat_map, box = _mapped(runs, [grids[k] for k in chosen], seeds[:SIDE])
    region = _region(runs, box, out)
    return replace(sure, edges=edges, map=heat_map, region=region)


def _seeds(own: int) -> list[int]:
    """Return the sensor seeds: first the finding's own, then the smallest other numbers."""
    return [own, *(seed for seed in range(SEEDS) if seed != own)][:SEEDS]


class _Runs:
    """Runs variants of a failure in processes of their own."""

    def __init__(self, subject: _Subject, jobs: int, progress: Progress) -> None:
        self.subject, self._jobs, self._progress = subject, jobs, progress
        self._done = self._planned = 0

    def reasons(self, seeds: Iterable[int]) -> list[str]:
        """Return for each sensor seed how the failure's run ended; "" if it did not fail."""
        return self._all(_reason, [self.subject.with_seed(seed) for seed in seeds], 1)

    def fail(self, variants: Iterable[_Variant]) -> list[Outcome]:
        """Return for each variant whether it fails."""
        return self._all(partial(_fails, self.subject), list(variants), 1)

    def edges(self, grids: Sequence[ValueGrid]) -> tuple[Edge, ...]:
        """Return the boundary of each changed value."""
        return tuple(self._all(partial(_edge, self.subject), list(grids), 2 * _FARTHEST))

    def _all(self, function: Callable[[Argument], Result], arguments: Sequence[Argument], runs: int) -> list[Result]:
        self._planned += len(arguments)
        deadline_s = DEADLINES.for_run_s(longest_s(self.subject.case)) * runs
        tasks = [Task(self.subject.case.id, function, argument, deadline_s) for argument in arguments]
        with WorkerPool(min(self._jobs, len(arguments))) as pool:
            return pool.outcomes(tasks, self._ended)

    def _ended(self, outcome: object) -> None:
        if isinstance(outcome, BrokenTask):
            raise ForeseeError(f"a run of {outcome.task.name} broke: {outcome.reason}")
        self._done += 1
        self._progress(self._done, self._planned)


def _reason(subject: _Subject) -> str:
    result = subject.setup.run(subject.case)
    return result.reason if result.verdict.is_failure else ""


def _fails(subject: _Subject, variant: _Variant) -> Outcome:
    """Return whether a variant fails; None if its values are not possible."""
    case, mutant = subject.case, subject.case.mutant
    if variant.changes is not None and mutant is not None and subject.clip is not None:
        others = tuple(item for item in mutant.body if not isinstance(item, m.Change))
        changed = mutant.model_copy(update={"body": (*variant.changes, *others)})
        try:
            again = parse(print_model(changed), case.id).model  # values out of their bounds raise here
            assert isinstance(again, m.Mutant)  # noqa: S101 - it was printed from one
            case = expand_mutant(again, subject.clip, source=case.source)
        except InputError:
            return None
    setup = subject.setup if variant.seed is None else subject.with_seed(variant.seed).setup
    try:
        return setup.run(case).verdict.is_failure
    except InputError:
        return None


def _changed(subject: _Subject, *values: m.Change) -> tuple[m.Change, ...]:
    """Return the finding's changes with some of them replaced."""
    mutant = subject.case.mutant
    new = {(change.actor, change.property): change for change in values}
    return tuple(new.get((c.actor, c.property), c) for c in (mutant.changes if mutant is not None else ()))


def _edge(subject: _Subject, grid: ValueGrid) -> Edge:
    """Return the boundary of one value on both sides, with real runs: of the first values on a side, then by bisection.

    The first values are tried one by one because the failing region may have gaps.
    """
    ended: dict[int, Outcome] = {0: True}

    def fails(k: int) -> bool:
        if k not in ended:
            ended[k] = _fails(subject, _Variant(_changed(subject, _at(grid, k))))
        return bool(ended[k])

    def passing(first: int, last: int) -> int:
        """Return an index whose value passes next to one whose value fails; `first` fails and `last` passes."""
        while abs(last - first) > 1:
            middle = (first + last) // 2
            first, last = (middle, last) if fails(middle) else (first, middle)
        return last

    def near(last: int) -> int | None:
        """Return the nearest of the first values towards `last` that passes; None if they all fail."""
        step = 1 if last > 0 else -1
        return next((k for k in range(step, step * min(NEIGHBOURS, abs(last)) + step, step) if not fails(k)), None)

    towards = near(grid.count)
    if towards is None and not fails(grid.count):
        towards = passing(min(NEIGHBOURS, grid.count - 1), grid.count)
    beyond = near(-_FARTHEST)
    farthest, far = -NEIGHBOURS, -NEIGHBOURS - 1
    while beyond is None and -far <= _FARTHEST and fails(far):
        farthest, far = far, 2 * far
    if beyond is None and -far <= _FARTHEST:
        beyond = passing(farthest, far)
    if beyond is not None and ended[beyond] is None:  # these values are not possible
        beyond = None
    return Edge(
        change=f"{grid.change.actor}.{grid.change.property}",
        unit=grid.unit,
        was=float(grid.was),
        fails=float(grid.now),
        passes=None if towards is None else _value(grid, towards),
        beyond=None if beyond is None else _value(grid, beyond),
        runs=len(ended) - 1,
    )


def _at(grid: ValueGrid, k: int) -> m.Change:
    """Return the change with the value at index `k` of its grid; index `count` has the unmutated value."""
    if k != grid.count:
        return grid.changed(k)
    return grid.change.model_copy(update={"now": m.Quantity(value=grid.was, unit=grid.unit)})


def _value(grid: ValueGrid, k: int) -> float:
    return float(_decimal(grid, k))


@dataclass(frozen=True)
class _Box:
    """A part of the map in which all runs fail. `sides`: for each changed value its grid, and the first and last index
    in it.
    """

    sides: tuple[tuple[ValueGrid, int, int], ...]
    spans: tuple[tuple[int, int], ...]
    """First and last index of each side of the whole map."""


def _mapped(runs: _Runs, grids: Sequence[ValueGrid], seeds: Sequence[int]) -> tuple[HeatMap, _Box]:
    """Run the map, and return it with the largest box of failing runs around the finding's own."""
    steps = [_numbers(grid) for grid in grids]
    across, *others = grids
    if others:
        down, rows = others[0], steps[1]
        variants = [_Variant(_changed(runs.subject, _at(across, k), _at(down, row))) for row in rows for k in steps[0]]
        names = [_text(down, row) for row in rows]
    else:
        variants = [_Variant(_changed(runs.subject, _at(across, k)), seed) for seed in seeds for k in steps[0]]
        names = [str(seed) for seed in seeds]
    outcomes = runs.fail(variants)
    fails = [outcomes[k : k + SIDE] for k in range(0, len(outcomes), SIDE)]
    heat_map = HeatMap(
        across=f"{across.change.actor}.{across.change.property}",
        down=f"{others[0].change.actor}.{others[0].change.property}" if others else SEED,
        columns=tuple(_text(across, k) for k in steps[0]),
        rows=tuple(names),
        fails=tuple(map(tuple, fails)),
        unmutated=tuple(_text(grid, grid.count) for grid in grids),
    )
    own = SIDE // 2
    top, bottom, left, right = _largest_box(fails if others else fails[:1], own if others else 0, own)
    sides = [(across, steps[0][left], steps[0][right])]
    if others:
        sides.append((others[0], steps[1][top], steps[1][bottom]))
    return heat_map, _Box(tuple(sides), tuple((numbers[0], numbers[-1]) for numbers in steps))


def _numbers(grid: ValueGrid) -> list[int]:
    """Return the indices of a grid along one side of the map, from the unmutated value to twice the change.

    A change of fewer steps than half the side has values beyond the unmutated one, too.
    """
    half = SIDE // 2
    return [round(max(grid.count, half) * k / half) for k in range(half, -half - 1, -1)]


def _text(grid: ValueGrid, k: int) -> str:
    return f"{_value(grid, k):.2f}{f' {grid.unit}' if grid.unit else ''}"


def _largest_box(fails: Sequence[Sequence[Outcome]], row: int, column: int) -> tuple[int, int, int, int]:
    """Return the rows and columns (first and last) of the largest rectangle of failing runs around one run."""
    height, width = len(fails), len(fails[0])
    best, area = (row, row, column, column), 1
    for top, bottom in combinations(range(-1, height), 2):
        for left, right in combinations(range(-1, width), 2):
            inside = top < row <= bottom and left < column <= right
            size = (bottom - top) * (right - left)
            if inside and size > area and all(all(line[left + 1 : right + 1]) for line in fails[top + 1 : bottom + 1]):
                best, area = (top + 1, bottom, left + 1, right), size
    return best


def _region(runs: _Runs, box: _Box, out: Path | None) -> Region:
    """Return the box as lines of the language, and how many of the cases fail that the language draws inside it."""
    subject = runs.subject
    assert subject.clip is not None  # noqa: S101 - a mutant's box
    names = [f"{grid.change.actor}_{grid.change.property}" for grid, _, _ in box.sides]
    lines, conditions = [], []
    for name, (grid, first, last), (start, end) in zip(names, box.sides, box.spans, strict=True):
        low, high = sorted((_decimal(grid, first), _decimal(grid, last)))
        least, most = sorted((_decimal(grid, start), _decimal(grid, end)))
        unit = f" {grid.unit}" if grid.unit else ""
        kind = m.Quantity(value=grid.now, unit=grid.unit).dimension
        lines.append(f"param {name}: {kind} = {grid.now}{unit} in {least}{unit}..{most}{unit} step {grid.step}{unit}")
        conditions += [f"{name} >= {low}{unit}", f"{name} <= {high}{unit}"]
    require = f"require {' and '.join(conditions)}"
    by_place = {
        (grid.change.actor, grid.change.property): name for name, (grid, _, _) in zip(names, box.sides, strict=True)
    }
    changes = [
        print_item(c.model_copy(update={"now": by_place.get((c.actor, c.property), c.now)})) for c in _changed(subject)
    ]
    with tempfile.TemporaryDirectory() as temporary:
        files = _scenarios(subject.clip, out or Path(temporary), [*lines, require], changes)
        scenario = Project(allow_outside=True).whole_scenario(files[-1])
        drawn = [case_values(scenario, case) for case in scenario.all(m.Case)]
        outcomes = runs.fail(_Variant(_at_values(subject, by_place, values)) for values in drawn)
    return Region(tuple(lines), require, len(outcomes), sum(map(bool, outcomes)), files if out is not None else ())


def _at_values(
    subject: _Subject, names: Mapping[tuple[str, str], str], values: Mapping[str, m.ParamValue]
) -> tuple[m.Change, ...]:
    """Return the finding's changes with the values of a drawn case; `names`: parameters by actor and property."""
    named = ((change, names.get((change.actor, change.property))) for change in _changed(subject))
    return tuple(change if name is None else change.model_copy(update={"now": values[name]}) for change, name in named)


def _decimal(grid: ValueGrid, k: int) -> Decimal:
    return grid.was if k == grid.count else grid.value(k)


def _scenarios(clip: TestCase, folder: Path, added: Sequence[str], changes: Sequence[str]) -> tuple[Path, Path]:
    """Write the clip as a scenario, and the scenario that extends it, into a folder; return their files."""
    apart = m.UseNetwork | m.UseModels | m.UseTracks | m.Network
    whole = expanded_model(clip)
    body = (*surroundings(clip, folder), *(item for item in whole.body if not isinstance(item, apart)))
    base = print_model(whole.model_copy(update={"name": "base", "body": body}))
    lines = [*(f"add {line}" for line in added), *changes, f"add cases {DRAWN} from seed 1"]
    remarks = "".join(f"# {line}\n" for line in (other_sensor_errors(clip.clip) if clip.clip is not None else ()))
    inside = "".join(f"  {line}\n" for line in lines)
    text = f'foresee 1\n\n{remarks}scenario region extends "base.foresee" {{\n{inside}}}\n'
    files = folder / "base.foresee", folder / "region.foresee"
    write_whole(files[0], base)
    write_whole(files[1], text)
    return files

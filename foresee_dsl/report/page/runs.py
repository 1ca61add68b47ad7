"""A failing run in a report: its story, its changes, the commands that reproduce it, and its playback."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from foresee_dsl.campaign.records import CaseRunOutcome, JudgedRun, WrittenMinimised
from foresee_dsl.compile import compile_test_case
from foresee_dsl.compile.bundle import SumoBundle
from foresee_dsl.compile.roads.network import RoadNetwork
from foresee_dsl.documents import or_null, where_set
from foresee_dsl.drivers.consent import may_start
from foresee_dsl.errors import DriverError, ForeseeError, InputError
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.model import Doc, Mutant, Origin, Quantity
from foresee_dsl.language.parser import load
from foresee_dsl.language.printer import print_item
from foresee_dsl.language.project.loading import Project
from foresee_dsl.report.drawing.ground import ground_of
from foresee_dsl.report.drawing.shapes import as_data, ground_shapes
from foresee_dsl.report.page.pictures import Thumbnail, thumbnail
from foresee_dsl.report.page.playback import Marks, Parent, ego_way, playback
from foresee_dsl.report.show.sources import ShownRun
from foresee_dsl.report.show.steps import reason_texts, recorded_steps
from foresee_dsl.report.show.strip import strip_svg
from foresee_dsl.simulate.results.outcome import contact_of, touched_at
from foresee_dsl.simulate.trace import Trace, X, Y
from foresee_dsl.story import Moment, Story, tell
from foresee_dsl.story.story import seen_for
from foresee_dsl.story.wording import quoted

_CACHED_PARENTS = 4
"""Number of test cases whose traces are kept in memory; children are read in the order of their test cases."""
AROUND_M = 120.0
"""Roads and buildings are shown up to this distance from the ego, m. Ours: the widest picture is 200 m across."""
TOLERANCE_M = 0.05
"""Lines are simplified with this tolerance, m. Ours: half a pixel at the usual 10 px/m."""


REASONS_EVERY_S = 0.2
"""Time between two moments for which a page states the driver's reasons, s. Ours: shorter than a reaction."""


@dataclass(frozen=True)
class FailingRun:
    """A failing run, and its files.

    Attributes:
        record: how it ended, with the answers of the judges.
        address: the argument of `foresee run`: the mutant's file, or the test case's address. trace: the trace's file.
        parent_trace: the trace's file of the test case from which a mutant was derived.
        beside: traces of reference drivers in the same situation, by driver.
        minimised: for a minimised mutant, how it was minimised. unreduced: the file of the mutant before that.
        why_made: why the mutant was made, in a sentence; "" if its file does not say.
    """

    name: str
    address: str
    record: JudgedRun
    driver: str
    seed: int
    trace: Path | None
    parent_trace: Path | None = None
    operators: tuple[str, ...] = ()
    beside: tuple[tuple[str, Path], ...] = ()
    minimised: WrittenMinimised | None = None
    unreduced: Path | None = None
    why_made: str = ""

    @property
    def verdict(self) -> str:
        """Return how the run ended, in a word."""
        return self.record.verdict.value

    @property
    def label(self) -> str:
        """Return the run's name, with a note if the mutant was minimised."""
        return f"{self.name}, minimised" if self.minimised is not None else self.name

    @property
    def unmutated(self) -> tuple[str, int, str] | None:
        """Return driver, seed and test case of a run without mutation, which campaigns of several rankers share; None
        for a mutant's.
        """
        return (self.driver, self.seed, self.address) if isinstance(self.record, CaseRunOutcome) else None


@dataclass(frozen=True)
class RunEntry:
    """A run as a report shows it.

    Attributes:
        id: id of its playback in the page; "" without one. title: its story's sentence, or else how the run ended.
        changes: the statements of the mutant, or of the minimised mutant if there is one.
        unreduced: if the mutant was minimised, its statements before that. note: how it was minimised.
        commands: label and command line of each command that reproduces it.
        missing: the reason for each part that cannot be shown.
    """

    outcome: FailingRun
    id: str
    title: str
    moments: tuple[Moment, ...]
    label: str
    class_: str = ""
    forecast: str = ""
    changes: tuple[str, ...] = ()
    unreduced: tuple[str, ...] = ()
    note: str = ""
    commands: tuple[tuple[str, str], ...] = ()
    missing: tuple[str, ...] = ()
    thumbnail: Thumbnail | None = None
    grounds: tuple[str, ...] = ()
    """The facts on which the judgement rests, in words."""

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {
            "name": self.outcome.name,
            "file": self.outcome.address,
            "verdict": self.outcome.verdict,
            "reason": self.outcome.record.reason,
            "sentence": self.title,
            "moments": self.moments,
            "changes": self.changes,
            "unreduced": self.unreduced,
            "why": self.outcome.record.preventability and self.outcome.record.preventability.why,
            "anticipation_why": self.outcome.record.anticipation and self.outcome.record.anticipation.why,
            "opinions": where_set(or_null(self.outcome.record.opinions)),
            "commands": self.command_lines,
            "missing": self.missing,
        }

    @property
    def command_lines(self) -> tuple[str, ...]:
        """Return the command lines without their labels."""
        return tuple(command for _, command in self.commands)


class PageRoads:
    """The road networks of a page's runs, each once, cropped to what is near the egos' tracks."""

    def __init__(self) -> None:
        self._networks: dict[int, RoadNetwork] = {}
        self._cells: dict[int, set[tuple[int, int]]] = {}

    def add(self, network: RoadNetwork, track: NDArray[np.float64]) -> str:
        """Add an ego's track, [T, 2], m, and return the id of its network in the page."""
        self._networks.setdefault(id(network), network)
        cells = self._cells.setdefault(id(network), set())
        present = track[~np.isnan(track[:, 0])]
        cells.update((int(x), int(y)) for x, y in np.unique(np.floor(present / AROUND_M), axis=0))
        return f"roads-{list(self._networks).index(id(network))}"

    def as_dict(self) -> dict[str, list[dict[str, Any]]]:
        """Return each network's shapes for the page, by its id."""
        return {
            f"roads-{k}": _geometry(network, self._cells[key])
            for k, (key, network) in enumerate(self._networks.items())
        }


def _geometry(network: RoadNetwork, cells: set[tuple[int, int]]) -> list[dict[str, Any]]:
    near = {(x + i, y + j) for x, y in cells for i in (-1, 0, 1) for j in (-1, 0, 1)}

    def is_near(points: Sequence[Sequence[float]], wide_m: float) -> bool:
        """Return whether the bounding box of a shape touches a cell near a track."""
        if not points:
            return False
        low = np.min(np.array(points)[:, :2], axis=0) - wide_m
        high = np.max(np.array(points)[:, :2], axis=0) + wide_m
        left, bottom = np.floor(low / AROUND_M).astype(int)
        right, top = np.floor(high / AROUND_M).astype(int)
        return any((x, y) in near for x in range(left, right + 1) for y in range(bottom, top + 1))

    return as_data(ground_shapes(ground_of(network, is_near), tolerance_m=TOLERANCE_M))


@dataclass
class Reader:
    """Reads the failing runs of campaigns. Each file, test case and network is read once."""

    roads: PageRoads = field(default_factory=PageRoads)
    playbacks: dict[str, dict[str, Any]] = field(default_factory=dict)
    """The playbacks of the runs that were read so far, by id."""
    plays: bool = True
    """Whether playbacks are computed, which takes most of the time."""
    reasons: bool = False
    """Whether runs are driven again for the driver's own reasons."""

    def __post_init__(self) -> None:
        self._project = Project(check_pin=False)
        self._trace = lru_cache(_CACHED_PARENTS)(Trace.load)

    def only(self, ids: Iterable[str]) -> Reader:
        """Return a reader with the playbacks of these runs alone."""
        return Reader(self.roads, {name: self.playbacks[name] for name in ids if name in self.playbacks})

    def read(self, outcome: FailingRun) -> RunEntry:
        """Return a run, read from its files; `RunEntry.missing` states the reason for each part that is missing."""
        missing: list[str] = []
        case = self._case(outcome, missing)
        trace = self._load(outcome.trace, missing)
        parent = self._parent(outcome, case, missing) if case is not None and trace is not None else None
        return self.run(outcome, case, trace, parent, missing)

    def run(
        self,
        outcome: FailingRun,
        case: TestCase | None,
        trace: Trace | None,
        parent: Parent | None = None,
        missing: Sequence[str] = (),
    ) -> RunEntry:
        """Return a run, with its story and its playback if its test case and its trace are available."""
        notes = list(missing)
        story, playback_id, small_picture = None, "", None
        if trace is not None and case is not None and (bundle := self._bundle(case, trace, notes)) is not None:
            story = tell(trace, case, bundle)
            if self.plays:
                playback_id = self._played(outcome, trace, case, bundle, story, parent)
                small_picture = thumbnail(trace, bundle, story.opponent)
        risk = case.clip.risk if case is not None and case.clip is not None else None
        small, large, note = _changes(outcome, case)
        return RunEntry(
            outcome=outcome,
            id=playback_id,
            title=story.sentence if story else outcome.record.reason,
            moments=story.moments if story else (),
            label=outcome.record.verdict.label,
            class_=story.contact.value if story else "",
            forecast=risk.text if risk is not None else "",
            changes=small,
            unreduced=large,
            note=note,
            commands=_commands(outcome),
            missing=tuple(notes),
            thumbnail=small_picture,
            grounds=tuple(_grounds(story)) if story else (),
        )

    def _played(
        self, outcome: FailingRun, trace: Trace, case: TestCase, bundle: SumoBundle, story: Story, parent: Parent | None
    ) -> str:
        """Store the playback of a run, and return its id."""
        name = f"run-{len(self.playbacks)}"
        played = playback(trace, bundle, _marks(trace, case, story.opponent), parent)
        played["roads"] = self.roads.add(bundle.network, trace.states[:, 0, [X, Y]])
        for driver, file in outcome.beside:
            with suppress(OSError, ValueError):
                played["others"].append({"driver": driver, "way": ego_way(Trace.load(file), trace.frames)})
        if self.reasons and may_start(outcome.driver):
            played["reasons"] = _reasons(ShownRun(outcome.address, case, trace, outcome.driver, outcome.seed))
        played["moments"] = [[round(m.time_s, 3), m.text] for m in story.moments]
        self.playbacks[name] = played
        return name

    def strip(self, outcome: FailingRun) -> str:
        """Return the picture of a run as SVG; "" if its files are missing."""
        missing: list[str] = []
        case, trace = self._case(outcome, missing), self._load(outcome.trace, missing)
        if case is None or trace is None or self._bundle(case, trace, missing) is None:
            return ""
        parent = self._parent(outcome, case, missing)
        ghost = parent.trace.part(parent.trace.frame_at(parent.start_s)) if parent is not None else None
        return strip_svg(trace, case, tell(trace, case), ghost=ghost)

    def _case(self, outcome: FailingRun, missing: list[str]) -> TestCase | None:
        try:
            return self._project.test_case(outcome.address)
        except InputError as err:
            missing.append(f"{outcome.address} can no longer be read: {err.diagnostics[0].message}")
        return None

    def _load(self, file: Path | None, missing: list[str]) -> Trace | None:
        if file is None:
            missing.append("no trace was recorded")
            return None
        try:
            return self._trace(file)
        except (OSError, ValueError):
            missing.append(f"the trace {file} is missing or damaged: run the campaign again to see the run")
        return None

    def _bundle(self, case: TestCase, trace: Trace, missing: list[str]) -> SumoBundle | None:
        recorded = trace.meta.get("meaning")
        if recorded is not None and recorded != case.meaning:
            missing.append("edited since it was run: the playback shows the recorded run")
        try:
            bundle = compile_test_case(case)
        except ForeseeError as err:
            missing.append(f"its road cannot be drawn: {err}")
            return None
        if [actor.id for actor in bundle.scene.actors] != [info.id for info in trace.actors]:
            missing.append("the file has other actors than the recorded run, which therefore cannot be played")
            return None
        return bundle

    def _parent(self, outcome: FailingRun, case: TestCase, missing: list[str]) -> Parent | None:
        if case.clip is None or outcome.parent_trace is None:
            return None
        trace = self._load(outcome.parent_trace, missing)
        return Parent(trace, case.clip.start_s) if trace is not None else None


def _reasons(run: ShownRun) -> list[list[Any]]:
    """Return the driver's own reasons, [time, [text, ...]] wherever they change; none if it drives otherwise now, and
    what is wrong with them instead if they cannot be read."""
    try:
        steps, same = recorded_steps(run, every_s=REASONS_EVERY_S)
    except DriverError as err:
        return [[0.0, [str(err)]]]
    reasons: list[list[Any]] = []
    for step in steps if same else ():
        texts = list(reason_texts(step, run.trace))
        if texts != (reasons[-1][1] if reasons else []):
            reasons.append([round(step.time_s, 2), texts])
    return reasons


def _grounds(story: Story) -> Iterator[str]:
    """Yield the facts on which the judgement of a run rests, in words."""
    if not story.opponent:
        return
    grounds, other = story.grounds, quoted(story.opponent)
    if grounds.steered:
        yield f"the mutation steers {other} into the ego"
    if grounds.breaks_rule:
        yield f"{other} {grounds.breaks_rule}"
    if grounds.gives_way:
        yield grounds.gives_way
    if grounds.signal:
        junction, _, colour = grounds.signal.rpartition(" ")
        yield f"the ego entered {quoted(junction)} on {colour}"
    if grounds.seen_s:
        yield f"the ego's sensors see {other} for the last {seen_for(grounds.seen_s)}"
    else:
        yield f"the ego's sensors do not see {other} at the end"
    if grounds.hidden_by:
        yield f"{other} was hidden by {grounds.hidden_by} before"
    if grounds.acts_s is not None:
        yield f"{other} begins its last manoeuvre {grounds.acts_s:.1f} s before the end"
    if grounds.stood_s:
        yield f"the ego has stood for {grounds.stood_s:.1f} s"
    elif grounds.braked_s:
        yield f"the ego brakes for the last {grounds.braked_s:.1f} s"
    else:
        yield "the ego does not brake"


def _marks(trace: Trace, case: TestCase, opponent: str) -> Marks:
    impact = contact_of(trace)
    risk = case.clip.risk if case.clip is not None else None
    forecast_s = None
    if case.clip is not None and risk is not None and isinstance(risk.at, Quantity):
        forecast_s = risk.at.si - case.clip.start_s
    return Marks(
        opponent=opponent or (risk.actor or "" if risk is not None else ""),
        contact_s=trace.duration_s if impact else None,
        contact=touched_at(trace, impact) if impact else None,
        forecast_s=forecast_s,
        forecast_with=risk.actor or "" if risk is not None else "",
    )


def _changes(outcome: FailingRun, case: TestCase | None) -> tuple[tuple[str, ...], tuple[str, ...], str]:
    """Return the changes of a mutant, its changes before it was minimised, and a note about that."""
    mutant = case.mutant if case is not None else None
    if mutant is None:
        return (), (), ""
    before: tuple[str, ...] = ()
    if outcome.unreduced is not None:
        with suppress(InputError, OSError):
            model = load(outcome.unreduced).model
            before = _statements(model) if isinstance(model, Mutant) else ()
    note = (mutant.origin.minimised if mutant.origin is not None else None) or ""
    return _statements(mutant), before, note


def _statements(mutant: Mutant) -> tuple[str, ...]:
    return tuple(print_item(item) for item in mutant.body if not isinstance(item, Origin | Doc))


def _commands(outcome: FailingRun) -> tuple[tuple[str, str], ...]:
    options = ("--driver", outcome.driver, "--seed", str(outcome.seed))
    return (("run it", shlex.join(("foresee", "run", outcome.address, *options))),)

"""Every number of a story is a number of its run: an independent reading of the trace, over real and recorded runs.

A sentence, a moment or a title is taken apart by the patterns of `CLAIMS`. A number that no pattern takes is an error,
as is one that the trace contradicts. `test_a_wrong_number_is_noticed` puts each number wrong and expects an error.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import takewhile
from pathlib import Path

import numpy as np
import pytest
import shapely

from foresee_dsl.campaign.driving import run_test_case
from foresee_dsl.compile import compile_test_case
from foresee_dsl.kernels.constants import STANDS_MPS
from foresee_dsl.language.document import TestCase
from foresee_dsl.language.model import Change, Quantity
from foresee_dsl.language.project.loading import load_test_case, load_test_cases
from foresee_dsl.simulate.sensing.sight import in_view, sight_of
from foresee_dsl.simulate.signals import colour_shown
from foresee_dsl.simulate.trace import Trace
from foresee_dsl.story import Moment, Story, tell
from tests.support.goldens import recorded_run
from tests.support.small_campaign import finished, write_project
from tests.support.small_street import STREET

X, Y, HEADING, SPEED, ACCELERATION = range(5)
STEP_S = 0.05
CASES = Path(__file__).parents[1] / "cases"
LIBRARY = {
    "scenario4/walker_on_the_crossing.foresee::elderly_from_the_left": "idm",
    "scenario4/roundabout_exit.foresee::to_the_north": "idm",
    "scenario8/hidden_behind_the_turner.foresee::scooter_behind_the_van": "pdm",
}
"""Bundled test cases with a crossing, a roundabout and a signal at which the ego gets stuck, and who drives them."""


@dataclass(frozen=True)
class Run:
    """A run, its story, and the frame at which its sentence ends."""

    name: str
    case: TestCase
    trace: Trace
    story: Story

    @property
    def other(self) -> int:
        return self.trace.index(self.story.opponent)

    @property
    def end(self) -> int:
        """A run that passed is told until the two are nearest, one that breaks a rule until then."""
        times = [m.time_s for m in self.story.moments if m.kind == "nearest"]
        if self.trace.meta["verdict"] == "rule":
            times = [broken["time_s"] for broken in self.trace.meta["infractions"]][:1]
        return round(times[0] / STEP_S) if times else self.trace.frames - 1

    def ego_at(self, frame: int) -> tuple[float, float]:
        x, y = self.trace.states[frame, 0, [X, Y]].tolist()
        return x, y

    def column(self, name: str) -> int:
        return 0 if name == "the ego" else self.trace.index(name.strip("'"))

    def ego(self, column: int) -> np.ndarray:
        return self.trace.states[:, 0, column]

    def gaps(self, actor: int) -> np.ndarray:
        """Distances of the two footprints, by shapely."""
        ours, theirs = (_rectangles(self.trace, k) for k in (0, actor))
        return np.where(np.isnan(self.trace.states[:, actor, X]), np.nan, shapely.distance(ours, theirs))

    def strongest(self, actor: int, frame: int, least: float, until: int | None = None) -> float:
        """The strongest braking of the one that begins at a frame: until 0.3 s without `least`."""
        braking = -self.trace.states[:, actor, ACCELERATION]
        last = frame
        for k in range(frame, self.trace.frames if until is None else until):
            last = k if braking[k] >= least and self.trace.states[k, actor, SPEED] > 0.1 else last
            if k - last > round(0.3 / STEP_S):
                break
        return float(np.nanmax(braking[frame : last + 1]))

    def relative_mps(self) -> float:
        (ox, oy), (ex, ey) = (self._velocity(k) for k in (self.other, 0))
        return math.hypot(ox - ex, oy - ey)

    def _velocity(self, actor: int) -> tuple[float, float]:
        speed, heading = (float(self.trace.states[-1, actor, c]) for c in (SPEED, HEADING))
        return speed * math.cos(heading), speed * math.sin(heading)

    def began(self, kind: str, actor: str = "ego") -> Moment:
        """The last moment of a kind at which something began, before the sentence ends."""
        return [m for m in self.story.moments if m.kind == kind and m.actor == actor and m.time_s <= self.end_s][-1]

    @property
    def end_s(self) -> float:
        return self.end * STEP_S + 1e-9


def _rectangles(trace: Trace, actor: int) -> np.ndarray:
    info, states = trace.actors[actor], np.nan_to_num(trace.states[:, actor])
    corners = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)]) * (info.length_m / 2, info.width_m / 2)
    cos, sin = np.cos(states[:, HEADING])[:, None], np.sin(states[:, HEADING])[:, None]
    x = states[:, X, None] + cos * corners[:, 0] - sin * corners[:, 1]
    y = states[:, Y, None] + sin * corners[:, 0] + cos * corners[:, 1]
    return np.asarray(shapely.polygons(np.stack([x, y], axis=2)))


Check = Callable[[Run, int, re.Match[str]], bool]
CLAIMS: list[tuple[str, Check]] = []
"""Pattern of a claim, and whether the run bears it out; the frame is that of the moment, or the sentence's end."""


def claim(pattern: str) -> Callable[[Check], Check]:
    def add(check: Check) -> Check:
        metres = r"(\d+ m|\d+\.\d+ m)"
        CLAIMS.append((pattern.replace("METRES", metres).replace("NUMBER", r"(\d+(?:\.\d+)?)"), check))
        return check

    return add


def near(text: str, value: float, room: float = 0.0) -> bool:
    """Whether a number, as written, is a value rounded to its decimals."""
    digits = text.removesuffix(" m")
    decimals = len(digits.partition(".")[2])
    return abs(float(digits) - value) <= 0.5001 * 10**-decimals + room


def kmh(text: str, speed_mps: float) -> bool:
    return near(text, speed_mps * 3.6)


@claim(r"the ego drives NUMBER km/h$")
def _begins(run: Run, frame: int, m: re.Match[str]) -> bool:
    return kmh(m[1], run.ego(SPEED)[frame])


@claim(r"brakes(?: hard)? with NUMBER m/s\^2, from NUMBER km/h")
def _brakes_moment(run: Run, frame: int, m: re.Match[str]) -> bool:
    harder = [
        round(x.time_s / STEP_S) for x in run.story.moments if x.kind == "brakes hard" and x.time_s > frame * STEP_S
    ]
    until = harder[0] if harder and "hard" not in m[0] else None
    return near(m[1], run.strongest(0, frame, 1.0, until)) and kmh(m[2], run.ego(SPEED)[frame])


@claim(r"brakes hard, with up to NUMBER m/s\^2")
def _brakes_hard(run: Run, frame: int, m: re.Match[str]) -> bool:
    return near(m[1], run.strongest(0, frame, 1.0))


@claim(r"('[^']+') brakes with NUMBER m/s\^2")
def _other_brakes(run: Run, frame: int, m: re.Match[str]) -> bool:
    return near(m[2], run.strongest(run.column(m[1]), frame, 2.0))


@claim(r"accelerates from NUMBER km/h to NUMBER km/h")
def _accelerates(run: Run, frame: int, m: re.Match[str]) -> bool:
    speed, acceleration = run.ego(SPEED), run.ego(ACCELERATION)
    in_sentence = frame == run.end
    start = round(run.began("accelerates").time_s / STEP_S) if in_sentence else frame
    last = start
    for k in range(start, run.trace.frames):
        last = k if acceleration[k] >= 0.8 else last
        if k - last > round(0.3 / STEP_S):
            break
    return kmh(m[1], speed[start]) and kmh(m[2], speed[frame if in_sentence else last])


@claim(r"creeps, at under NUMBER km/h")
def _creeps(run: Run, frame: int, m: re.Match[str]) -> bool:
    return near(m[1], 10.8) and bool((run.ego(SPEED)[frame : frame + 31] < 3.0).all())


def visible(run: Run, actor: str) -> np.ndarray:
    """At which frames an actor is in sight of the ego."""
    bundle = compile_test_case(run.case)
    sight, column = sight_of(bundle), run.column(actor)
    return np.array([in_view(run.trace, column, frame, sight) for frame in range(run.trace.frames)])


@claim(r"the ego sees ('[^']+')[^;]*, hidden by .* since NUMBER s")
def _hidden_since(run: Run, frame: int, m: re.Match[str]) -> bool:
    seen = visible(run, m[1])
    last = int(np.flatnonzero(seen[: frame - 5])[-1])
    return " again," in m[0] and near(m[2], last * STEP_S) and not seen[frame - 5 : frame].any()


@claim(r"the ego sees ('[^']+')[^;]*, hidden by .* until then")
def _hidden_until(run: Run, frame: int, m: re.Match[str]) -> bool:
    return " again," not in m[0] and not visible(run, m[1])[max(run.trace.frames - 200, 0) : frame - 5].any()


@claim(r"the ego (?:sees|loses sight of) ('[^']+')(?: \([^)]*\))?(?: again)?(?:, METRES away)?")
def _sees(run: Run, frame: int, m: re.Match[str]) -> bool:
    return m[2] is None or near(m[2], run.gaps(run.column(m[1]))[frame])


@claim(r"('[^']+')[^;]*?, METRES from the ego$")
def _from_the_ego(run: Run, frame: int, m: re.Match[str]) -> bool:
    return near(m[2], run.gaps(run.column(m[1]))[frame])


@claim(r"relative speed(?: of)? NUMBER m/s")
def _contact(run: Run, _: int, m: re.Match[str]) -> bool:
    return near(m[1], run.relative_mps(), 0.05)


@claim(r"('[^']+') is nearest, METRES away")
def _nearest(run: Run, frame: int, m: re.Match[str]) -> bool:
    gaps = run.gaps(run.column(m[1]))
    return near(m[2], gaps[frame]) and gaps[frame] <= np.nanmin(gaps) + 1e-6


@claim(r"they come as near as METRES")
def _as_near(run: Run, _: int, m: re.Match[str]) -> bool:
    return near(m[1], float(np.nanmin(run.gaps(run.other))))


@claim(r"METRES (?:ahead of|from) the (?:ego at NUMBER km/h|standing ego)")
def _when_it_began(run: Run, _: int, m: re.Match[str]) -> bool:
    kinds = ("onto the road", "enters", "moves off", "steered")
    frames = [round(x.time_s / STEP_S) for x in run.story.moments if x.kind in kinds and x.actor == run.story.opponent]
    gaps, speed = run.gaps(run.other), run.ego(SPEED)
    return any(
        near(m[1], gaps[k]) and (speed[k] < 0.1 if m[2] is None else kmh(m[2], speed[k]))
        for frame in frames
        for k in (frame, frame - 1)
    )


@claim(r"(?:last )?sees it (?:again )?NUMBER s before the contact")
def _seen_before(run: Run, _: int, m: re.Match[str]) -> bool:
    kind = "unseen" if m[0].startswith("last") else "appears"
    appears = run.began(kind, run.story.opponent)
    return near(m[1], run.end_s - appears.time_s, 0.051 if kind == "unseen" else 0.001)


@claim(r"has had it in sight for NUMBER s")
def _in_sight(run: Run, frame: int, m: re.Match[str]) -> bool:
    since = [x.time_s for x in run.story.moments if x.kind == "appears"]
    return near(m[1], run.end_s - since[-1] if since else 10.0, 0.001)


@claim(r"brakes from NUMBER km/h with up to NUMBER m/s\^2")
def _brakes(run: Run, _: int, m: re.Match[str]) -> bool:
    kinds = [
        x
        for x in run.story.moments
        if x.actor == "ego" and x.kind in ("brakes", "brakes hard") and x.time_s <= run.end_s
    ]
    hard = kinds[-1].text.startswith("the ego brakes hard, with")
    start = round(kinds[-2 if hard else -1].time_s / STEP_S)
    return kmh(m[1], run.ego(SPEED)[start]) and near(m[2], run.strongest(0, start, 1.0))


@claim(r"brakes to a stand with up to NUMBER m/s\^2")
def _brakes_to_a_stand(run: Run, frame: int, m: re.Match[str]) -> bool:
    starts = [
        round(x.time_s / STEP_S) for x in run.story.moments if x.kind in ("brakes", "brakes hard") and x.actor == "ego"
    ]
    values = [run.strongest(0, start, 1.0) for start in starts[-2:]]
    return any(near(m[1], value) for value in values) and run.ego(SPEED)[frame] < 0.1


@claim(r"(?:has stood|stands) for NUMBER s")
def _has_stood(run: Run, frame: int, m: re.Match[str]) -> bool:
    moving = np.flatnonzero(run.ego(SPEED)[: frame + 1] >= 0.1)
    return near(m[1], (frame - (int(moving[-1]) + 1 if moving.size else 0)) * STEP_S, 0.001)


@claim(r"(?:drives on|creeps|leaves the road) at NUMBER km/h")
def _speed_at_the_end(run: Run, frame: int, m: re.Match[str]) -> bool:
    return kmh(m[1], run.ego(SPEED)[frame])


@claim(r" at NUMBER s; it")
def _rule_time(run: Run, _: int, m: re.Match[str]) -> bool:
    return near(m[1], run.trace.meta["infractions"][0]["time_s"])


@claim(r"slowest NUMBER m/s|up to NUMBER km/h faster than")
def _of_rule(run: Run, _: int, m: re.Match[str]) -> bool:
    values = [broken["value"] for broken in run.trace.meta["infractions"] if broken["value"] is not None]
    return any(near(m[1], value) if m[1] else kmh(m[2], value) for value in values)


@claim(r"METRES before the [a-z -]+ ('[^']+')")
def _before_the_junction(run: Run, frame: int, m: re.Match[str]) -> bool:
    """From the ego's front to the end of the nearest lane that leads into the junction."""
    network, ego = compile_test_case(run.case).network, run.trace.states[frame, 0]
    front = ego[[X, Y]] + run.trace.actors[0].length_m / 2 * np.array((math.cos(ego[HEADING]), math.sin(ego[HEADING])))
    ends = [network.lanes[x.from_lane].shape[-1] for x in network.movements if x.junction == m[2].strip("'")]
    return near(m[1], min(math.hypot(*(front - end[:2])) for end in ends), 0.2)


@claim(r"whose signal is (red|amber|green) for the last NUMBER s")
def _colour_shown(run: Run, frame: int, m: re.Match[str]) -> bool:
    """A signal of a lane beside the ego has had the colour for so long, and another one before."""
    bundle, (x0, y0) = compile_test_case(run.case), run.ego_at(frame)
    name = re.search(r"before the [a-z -]+'([^']+)'", run.story.sentence)
    assert name is not None
    signal, column = bundle.signals[name[1]], run.trace.signals.index(name[1])

    def colour(link: int, at: int) -> str:
        stage = run.trace.signal_stages[column][run.trace.stages[at, column]]
        return colour_shown(signal.phases[signal.phase_at(stage, float(run.trace.elapsed[at, column]))[0]].state, link)

    theirs = [x for x in bundle.network.movements if x.tls == signal.tls]
    ends = {x.from_lane: bundle.network.lanes[x.from_lane].shape[-1] for x in theirs}
    links = [x.link for x in theirs if math.hypot(ends[x.from_lane][0] - x0, ends[x.from_lane][1] - y0) < 10]
    shown = [[colour(link, at) for at in range(frame + 1)] for link in links]
    lasts = [len(list(takewhile(lambda now: now == m[1], reversed(colours)))) - 1 for colours in shown]
    return any(near(m[2], last * STEP_S, 0.001) for last in lasts)


@claim(r"no (?:junction|actor) (?:is )?within NUMBER m")
def _nothing_within(run: Run, frame: int, m: re.Match[str]) -> bool:
    return m[1] == "30"


@claim(r"with ('[^']+')(?: \([^)]*\))? METRES in front of it")
def _in_front(run: Run, frame: int, m: re.Match[str]) -> bool:
    return near(m[2], run.gaps(run.column(m[1]))[frame])


@claim(r"is NUMBER times as fast")
def _times(run: Run, _: int, m: re.Match[str]) -> bool:
    return any(near(m[1], now / was) for _, was, now in changes(run, "timing"))


@claim(r"('[^']+') (?:starts|goes on) NUMBER s (?:later|earlier)")
def _starts(run: Run, _: int, m: re.Match[str]) -> bool:
    walks = run.trace.states[0, run.column(m[1]), SPEED] > STANDS_MPS  # when the clip begins
    return ("goes on" in m[0]) == walks and any(near(m[2], abs(now - was)) for _, was, now in changes(run, "delay"))


@claim(r"keeps NUMBER m farther")
def _line(run: Run, _: int, m: re.Match[str]) -> bool:
    return any(near(m[1], abs(now - was)) for _, was, now in changes(run, "line"))


@claim(r"is steered to the (?:left|right) from NUMBER s")
def _steer(run: Run, _: int, m: re.Match[str]) -> bool:
    return any(isinstance(c.start, Quantity) and near(m[1], c.start.si) for c, _, _ in changes(run, "steer"))


@claim(r"drives NUMBER instead of NUMBER km/h")
def _speeds(run: Run, _: int, m: re.Match[str]) -> bool:
    return any(kmh(m[1], now) and kmh(m[2], was) for _, was, now in changes(run, "speed"))


def changes(run: Run, kind: str) -> Iterator[tuple[Change, float, float]]:
    for change in run.case.mutant.changes if run.case.mutant else ():
        if change.property == kind and isinstance(change.now, Quantity) and isinstance(change.was, Quantity):
            yield change, change.was.si, change.now.si


def errors(run: Run, text: str, frame: int) -> list[str]:
    """What of a text the run does not bear out, and the numbers that no pattern takes."""
    wrong, rest = [], text
    for pattern, check in CLAIMS:
        for match in re.finditer(pattern, text):
            if not check(run, frame, match):
                wrong.append(match[0])
            rest = rest.replace(match[0], re.sub(r"\d", "", match[0]))
    left = re.sub(r"'[^']*'|m/s\^2", "", rest)
    return wrong + ([f"not checked: {left}"] if re.search(r"\d", left) else [])


def texts(run: Run) -> Iterator[tuple[str, int]]:
    """The texts of a story, each with the frame of which it speaks."""
    yield run.story.sentence, run.end
    yield run.story.title, run.end
    for moment in run.story.moments:
        yield moment.text, round(moment.time_s / STEP_S)


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory, scenarios: Path) -> tuple[Run, ...]:
    """All findings of a small campaign, the golden runs, and some of the bundled library."""
    root = tmp_path_factory.mktemp("numbers")
    (root / "street.foresee").write_text(STREET)
    result = finished([write_project(root), root / "street.foresee"], root / "out")
    traces = {}
    for finding in result.findings:
        file = root / "out" / (finding.reduced or finding).file
        traces[finding.name] = load_test_case(str(file)), Trace.load(file.with_suffix(".npz"))
    for folder in sorted((CASES / "story").iterdir()) + sorted((CASES / "forecast").iterdir()):
        if (folder / "trace.npz").is_file():
            traces[folder.name] = recorded_run(folder, rewrite=False)
    for address, driver in LIBRARY.items():
        case = load_test_case(str(scenarios / address))
        traces[address] = case, run_test_case(case, driver, 0).trace
    return tuple(Run(name, case, trace, tell(trace, case)) for name, (case, trace) in traces.items())


def test_every_number_of_a_story_is_one_of_its_run(runs: tuple[Run, ...]) -> None:
    assert len(runs) >= 10
    wrong = [
        f"{run.name}: {text!r}: {e}" for run in runs for text, frame in texts(run) for e in errors(run, text, frame)
    ]
    assert not wrong, "\n".join(wrong)


def test_a_wrong_number_is_noticed(runs: tuple[Run, ...]) -> None:
    """Each number of each text, put a tenth and a bit too high, is an error."""
    unnoticed, count = [], 0
    for run in runs:
        for text, frame in texts(run):
            names = [m.span() for m in re.finditer(r"'[^']*'|m/s\^2", text)]
            for number in re.finditer(r"\d+(?:\.\d+)?", text):
                if any(a <= number.start() < b for a, b in names):
                    continue
                decimals = len(number[0].partition(".")[2])
                value = f"{float(number[0]) * 1.1 + 2 * 10**-decimals:.{decimals}f}"
                bad, count = text[: number.start()] + value + text[number.end() :], count + 1
                if not errors(run, bad, frame):
                    unnoticed.append(bad)
    assert count > 100 and not unnoticed, "\n".join(unnoticed)


def test_moments_are_where_they_say(runs: tuple[Run, ...]) -> None:
    """The moment at which an actor moves off, comes onto the road or enters a junction is that of the trace."""
    for run in runs:
        drivable = compile_test_case(run.case).network.drivable
        for moment in run.story.moments:
            frame, actor = round(moment.time_s / STEP_S), run.trace.index(moment.actor)
            state = run.trace.states[:, actor]
            if moment.kind == "moves off":
                assert state[frame - 1, SPEED] < 0.1 <= state[frame, SPEED], (run.name, moment)
            elif moment.kind == "onto the road":
                on = shapely.contains_xy(drivable, state[frame - 1 : frame + 1, X], state[frame - 1 : frame + 1, Y])
                assert on.tolist() == [False, True], (run.name, moment)
            elif moment.kind == "stops":
                assert state[frame - 1, SPEED] >= 0.1 > state[frame, SPEED], (run.name, moment)


def test_the_sentence_does_not_deny_its_moments(runs: tuple[Run, ...]) -> None:
    """An ego that accelerates in the sentence does so in a moment, and one that brakes, brakes."""
    for run in runs:
        for word, kinds in ((" accelerates ", ("accelerates",)), (" brakes ", ("brakes", "brakes hard"))):
            ego = run.story.sentence.rpartition("; the ego")[2]
            moments = [m for m in run.story.moments if m.actor == "ego" and m.kind in kinds]
            assert word not in f" {ego} " or moments, run.story.sentence
        assert "the standing ego" not in run.story.sentence or " brakes to a stand " not in run.story.sentence


def test_an_opponent_that_is_only_followed_is_not_passed(runs: tuple[Run, ...]) -> None:
    assert not [run.name for run in runs if "pass each other" in run.story.sentence]


def test_names_of_the_file_are_in_quotes(runs: tuple[Run, ...]) -> None:
    for run in runs:
        if run.story.opponent and run.story.contact.value != "broke a traffic rule":
            assert f"'{run.story.opponent}'" in run.story.sentence


def test_a_copy_with_another_ending_is_told_otherwise(runs: tuple[Run, ...]) -> None:
    """The check itself depends on the trace: another trace does not bear the same sentence out."""
    run = next(run for run in runs if run.name == "out_from_behind")
    faster = run.trace.states.copy()
    faster[:, 0, SPEED] *= 1.2
    other = replace(run, trace=replace(run.trace, states=faster))
    assert errors(other, run.story.sentence, run.end)
    assert load_test_cases([str(CASES / "story" / "out_from_behind" / "scenario.foresee")])

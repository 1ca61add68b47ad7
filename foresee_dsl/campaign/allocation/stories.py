"""The allocation `stories`: mutants go where they may still add something to an archive with one cell for each story.

A cell is a finding: failures are grouped by the same words (`grouping.story_cell`). An *arm* is a clip with a
way of drawing. Its expected gain is the probability that its next mutant fails, times what a failure there may add:
most for a new story, less for the first avoidable failure of a known one, little for a weaker change. Each mutant goes
to the arm with the largest expected gain, and what it is expected to find counts before it has run.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from foresee_dsl.campaign.allocation.draws import ClipDraws, ClipGroup, DrawMethod, DrawOption, PastChild, RoundBudget
from foresee_dsl.derive.mutate import How

NEW_UNAVOIDED = 0.5
"""Gain of a failure with a new story that is not known to be avoidable; 1 if it is avoidable. Ours."""
FIRST_AVOIDED = 0.2
"""Gain of an avoidable failure of a story that was not known to be avoidable. Ours: in replays
(docs/background/method.md), 0.5 sent too many mutants to clips that had failed: another failure of a story is seldom
avoidable if the first was not.
"""
SIMPLER = 0.005
"""Gain of a failure of a known story, which may have a weaker or simpler change than those before. Ours: that adds no
finding, but makes one easier to read; in replays, 0.05 cost findings."""
FAILS = 0.1
"""Assumed share of failing mutants, before there are results. Ours: with the preset `focused` about 5 % fail."""
NEW = (0.6, 0.25, 0.05)
"""Assumed share of failures with a new story, before there are results: of the first failure of a clip, of the second,
and of further ones. Ours: 0.62, 0.23 and 0.05 of 91 failures of the even half."""
AVOIDED = 0.5
"""Assumed share of avoidable failures, before there are results. Ours: it decides nothing until some are known."""
GROUP_WEIGHT = 20.0
"""Number of imagined mutants of average kind in the estimate of a group: equal kind, way, family or rank. Ours: in
replays, 10 and 40 found fewer stories."""
WEIGHT = 4.0
"""The same in the estimate of a clip, and in the shares of new stories and of avoidable failures. Ours: the default
number of children."""
OWN_WEIGHT = 0.25
"""The same in the estimate of one way in one clip. Ours: a second mutant by the same operators ends like the first more
often than not; in replays, 1 and 2 found fewer stories."""
NEAR_CREDIT = 0.3
"""Share of a failure as which a pass with the nearest possible miss counts for its clip; any other pass counts as this
times the square of its nearness. Ours: 8 of 41 clips whose first mutant nearly failed failed later, 8 of 107 others.
"""
MOST = 2
"""Largest number of mutants of one clip and seed in one round, as a multiple of the mean; more if nothing else can be
drawn. Ours: in replays, 1 and 4 found fewer stories."""


@dataclass
class Archive:
    """One cell for each story that was found: whether a failure of it is avoidable; and the stories of each clip."""

    cells: dict[tuple[str, ...], bool] = field(default_factory=dict)
    by_clip: defaultdict[str, list[tuple[str, ...]]] = field(default_factory=lambda: defaultdict(list))

    def add(self, child: PastChild) -> bool:
        """Add a failure; return whether its story is new."""
        story, new = child.facts.story, child.facts.story not in self.cells
        self.cells[story] = child.avoided or self.cells.get(story, False)
        self.by_clip[child.clip].append(story)
        return new

    def unavoided(self, clip: str) -> bool:
        """Return whether a clip has a failure of a story that is not known to be avoidable."""
        return any(not self.cells[story] for story in self.by_clip.get(clip, ()))


class Share:
    """The share of successes among trials, as an estimate that begins at a wider one."""

    def __init__(self) -> None:
        """Begin without trials."""
        self.successes, self.trials = 0.0, 0

    def add(self, success: float) -> None:
        """Add a trial."""
        self.successes += success
        self.trials += 1

    def near(self, wider: float, *, weight: float = 0.0, more: int = 0) -> float:
        """Return the estimate, between the wider one and the own share; `more`: further trials without success."""
        weight = weight or WEIGHT
        return (self.successes + weight * wider) / (self.trials + more + weight)


class Gain(NamedTuple):
    """The expected gain of an arm, and the probability of a failure in it."""

    value: float
    fails: float


class Estimates:
    """Probabilities of failures, of new stories and of avoidable ones, from all mutants so far."""

    def __init__(self, past: Sequence[PastChild]) -> None:
        """Count the mutants; `past`: in the order of their rounds."""
        self.archive = Archive()
        self.failing: defaultdict[tuple[object, ...], Share] = defaultdict(Share)
        self._new, self._avoided = tuple(Share() for _ in NEW), Share()
        self._avoided_by: defaultdict[DrawMethod, Share] = defaultdict(Share)
        self._given_out: Counter[tuple[str, DrawMethod]] = Counter()
        """Number of mutants of this round that were given out, by clip and way."""
        self._unfailed: defaultdict[str, float] = defaultdict(lambda: 1.0)
        """Probability that no mutant of this round fails, by clip."""
        for child in past:
            fails = bool(child.facts.story)
            for group in groups(child.way, child.group):
                self.failing[group].add(fails)
            self.failing["clip", child.clip].add(1.0 if fails else NEAR_CREDIT * child.facts.nearness**2)
            self.failing[child.clip, child.way].add(fails)
            if fails:
                had = len(self.archive.by_clip.get(child.clip, ()))
                self._new[min(had, len(NEW) - 1)].add(self.archive.add(child))
                self._avoided.add(child.avoided)
                self._avoided_by[child.way].add(child.avoided)

    def fails(self, clip: str, group: ClipGroup, way: DrawMethod) -> float:
        """Return the probability that the next mutant of an arm fails."""
        mean = self.failing["all",].near(FAILS)
        factors = (self.failing[name].near(mean, weight=GROUP_WEIGHT) / mean for name in groups(way, group)[1:])
        estimate = min(1.0, mean * math.prod(factors))
        estimate = self.failing["clip", clip].near(estimate)
        return self.failing[clip, way].near(estimate, weight=OWN_WEIGHT, more=self._given_out[clip, way])

    def gain(self, clip: str, group: ClipGroup, way: DrawMethod, *, of_known: bool = False) -> Gain:
        """Return the expected gain of an arm; `of_known`: a failure would have a story that the clip already has."""
        fails = self.fails(clip, group, way)
        avoided = self._avoided_by[way].near(self._avoided.near(AVOIDED))
        now, then = self._new_after(len(self.archive.by_clip.get(clip, ())))
        new = 0.0 if of_known else then + self._unfailed[clip] * (now - then)
        freed = FIRST_AVOIDED * avoided if self.archive.unavoided(clip) else 0.0
        worth = new * (NEW_UNAVOIDED + (1 - NEW_UNAVOIDED) * avoided) + (1 - new) * (freed + SIMPLER)
        return Gain(fails * worth, fails)

    def _new_after(self, failures: int) -> tuple[float, float]:
        """Return the probability that the next failure of a clip has a new story, and that the one after it has.

        `failures`: number of failures of the clip.
        """
        now, then = (min(failures + k, len(NEW) - 1) for k in (0, 1))
        return self._new[now].near(NEW[now]), self._new[then].near(NEW[then])

    def expect(self, clip: str, way: DrawMethod, fails: float) -> None:
        """Count a mutant of this round that has not run."""
        self._given_out[clip, way] += 1
        self._unfailed[clip] *= 1 - fails

    def words(self, clip: str, group: ClipGroup, way: DrawMethod) -> str:
        """Return the counts behind an arm's gain in words."""
        same, rank = self.failing["way", way], self.failing["rank", group.rank]
        own = len(self.archive.by_clip.get(clip, ()))
        counts = f"{same.successes:.0f} of {same.trials} children by"
        by_way = f"{counts} {way.made_by}" if same.trials else f"{way.made_by} is new"
        by_rank = f"{rank.successes:.0f} of {rank.trials} at risky points of rank {group.rank}"
        return f"failed so far: {by_way}; {by_rank}; {own or 'none'} of its clip"


def groups(way: DrawMethod, clip: ClipGroup) -> tuple[tuple[object, ...], ...]:
    """Return the groups of mutants that a mutant belongs to: all of them, and those of equal kind, way, family and
    rank.
    """
    return ("all",), ("how", way.how), ("way", way), ("family", clip.family), ("rank", clip.rank)


class Stories:
    """Each mutant goes to the arm with the largest expected gain."""

    rounds = 4
    """Number of rounds. Ours: as `adaptive`; in replays, 6 found fewer stories, as more of the early failures are
    followed at once."""
    words = "more where they may still add a story, or an avoidable failure of a known one"

    def give_out(self, clips: Sequence[ClipDraws], past: Sequence[PastChild], budget: RoundBudget) -> None:
        """Request the mutants of a round; of arms with equal gains, the one whose clip has the smallest hash."""
        estimates, counts = Estimates(past), Counter[str]()
        best = {clip.pin: _best_arm(clip, estimates) for clip in clips}
        most = math.ceil(MOST * budget.children / max(1, sum(len(clip.units) for clip in clips)))
        while counts.total() < budget.children:
            able = [clip for clip in clips if best[clip.pin] is not None]
            arms = [
                (arm, clip) for clip in able if (arm := best[clip.pin]) and counts[clip.pin] < most * len(clip.units)
            ]
            if not able:
                return
            if not arms:
                most += 1
                continue
            arm, clip = max(arms, key=lambda pair: pair[0].gain.value)
            clip.want(arm.option, arm.way.how, _why(clip, arm, estimates))
            counts[clip.pin] += 1
            estimates.expect(clip.pin, arm.way, arm.gain.fails)
            best[clip.pin] = _best_arm(clip, estimates)


class _Arm(NamedTuple):
    """The best way of drawing from a clip, and the mutant that it would give."""

    gain: Gain
    way: DrawMethod
    option: DrawOption


def _best_arm(clip: ClipDraws, estimates: Estimates) -> _Arm | None:
    arms = [_arm(clip, estimates, way, clip.anew(way)) for way in clip.ways]
    for how in (How.NEAR, How.BESIDE, How.WEAKER):
        arms += [
            _arm(clip, estimates, way, option) for way, option in clip.best_bases(how, _useful(clip, estimates)).items()
        ]
    return max(arms, key=lambda arm: arm.gain.value, default=None)


def _useful(clip: ClipDraws, estimates: Estimates) -> Callable[[DrawOption], bool]:
    """Return whether a mutant is worth varying: of failures only those whose story is not known to be avoidable."""

    def useful(option: DrawOption) -> bool:
        story = clip.facts(option).story
        return not story or not estimates.archive.cells[story]

    return useful


def _arm(clip: ClipDraws, estimates: Estimates, way: DrawMethod, option: DrawOption) -> _Arm:
    return _Arm(estimates.gain(clip.pin, clip.group, way, of_known=way.how is How.WEAKER), way, option)


def _why(clip: ClipDraws, arm: _Arm, estimates: Estimates) -> str:
    if arm.option.base is None:
        return estimates.words(clip.pin, clip.group, arm.way)
    return f"{clip.why_near(arm.option)}{_DOES[arm.way.how]}"


_DOES = {
    How.NEAR: ": its changes are varied a little",
    How.BESIDE: ": its run was forecast, and a change added",
    How.WEAKER: ", and no driver is known to avoid it: the same with less strength",
}

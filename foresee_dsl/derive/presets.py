"""Presets, which are named settings of the mutation operators."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Literal

from foresee_dsl.avoidance.candidates.behaviours import CarefulSettings
from foresee_dsl.errors import ForeseeError

Target = Literal["ranked", "letter"]


class UnknownPresetError(ForeseeError):
    """Raised if there is no preset of the name."""


@dataclass(frozen=True, slots=True)
class SteerSettings:
    """Settings of steering perturbations.

    Attributes:
        low, high: bounds of the angle, as shares of the largest one: -1 (right) to 1 (left) (paper, section 3.4).
        step: values are multiples of it.
        least_share: share of the largest allowed angle below which values are left out, as they have no effect.
        before_point_s: time from the onset to the risky point; None: the onset is the clip's beginning.
        hold_s: how long the angle is held; None for the whole clip.
        lateral_g: largest lateral acceleration from the steering alone, in g; None: only the tyres limit it.
        rate_rad_s: turning rate at which the front wheels must reach the angle within half of `hold_s`; None: no such
            limit.
        least_speed_mps: speed at the onset below which a target is not steered.
    """

    low: float = -1.0
    high: float = 1.0
    step: float = 0.01
    least_share: float = 0.0
    before_point_s: float | None = None
    hold_s: float | None = None
    lateral_g: float | None = None
    rate_rad_s: float | None = None
    least_speed_mps: float = 0.0


@dataclass(frozen=True, slots=True)
class TimingSettings:
    """Settings of `timing`, which scales the speed of a target along its own path.

    Attributes:
        low, high: bounds of the factor. Ours: within the differences between drivers on one road.
        step: values are multiples of it.
        least_change: smallest difference of the factor from 1. Ours: 0.05 shifts 5 s of driving by a quarter of a
            second.
        least_way_m: distance driven up to the risky point below which a target's timing is not changed. Ours: the
            length of a step.
    """

    low: float = 0.6
    high: float = 1.4
    step: float = 0.01
    least_change: float = 0.05
    least_way_m: float = 1.0


@dataclass(frozen=True, slots=True)
class DelaySettings:
    """Settings of `delay`, which lets a target stand longer before it moves.

    Attributes:
        low_s, high_s: smallest and largest delay. Ours: 1.5 s is an ordinary hesitation at a kerb, 0.2 s moves a walker
            by a foot's length.
        step_s: values are multiples of it (one step of the simulation).
    """

    low_s: float = 0.2
    high_s: float = 1.5
    step_s: float = 0.05


@dataclass(frozen=True, slots=True)
class HeadStartSettings:
    """Settings of `head_start`, which puts a target further along its path at the beginning.

    Attributes:
        low_s, high_s: the target begins at a place where it was this much later in the run. Ours: 0.2 s moves a walker
            by a foot's length; with a second at most, four fifths of the way to the risky point are left.
        least_m: smallest head start, as a smaller one has no effect. Ours: half a walker's depth.
    """

    low_s: float = 0.2
    high_s: float = 1.0
    least_m: float = 0.2


@dataclass(frozen=True, slots=True)
class LineSettings:
    """Settings of `line`, which lets a target walk or ride beside its own path.

    Attributes:
        high_m: largest offset to either side. Ours: from the middle of a lane of 3.3 m, a bicycle 0.6 m wide comes
            within 0.35 m of the marking; a walker stays on a crossing of 4 m.
        step_m: values are multiples of it.
        least_m: smallest offset. Ours: half a bicycle's or walker's width.
    """

    high_m: float = 1.0
    step_m: float = 0.05
    least_m: float = 0.3


@dataclass(frozen=True, slots=True)
class MutationPreset:
    """The settings with which clips are mutated.

    Attributes:
        recipes: each lists the operators of one child. The children take turns over the recipes whose operators can all
            act on their targets (if there are no such recipes, over the operators of each recipe that can act).
        targets: `letter`: model swap acts on the closest relevant actor, steering on the vehicle closest to the ego at
            the clip's beginning (paper, section 3.4). `ranked`: all operators act on the actor that the risky point
            names; if it names none, or one that no operator can change, on the actor closest to the ego at the point.
        draws: number of draws per child; the one whose roll-out comes nearest to the recorded ego becomes the child.
        reach_m: gap to the ego that a draw must reach for the ranked actor to be the target; otherwise the closest
            actor that reaches it is (no timing brings an actor near from behind a fence). None: the ranked actor stays
            the target.
        farthest_m: distance to the ego at the risky point above which an actor is not a target; None for no limit.
        search: the children are first the best candidates of this search (`avoidance.candidates`), for any actor; the
            other settings of this preset make the remaining children. None: no search.
        ends_early: a child's run ends as soon as it can only pass; False in the presets of the paper, whose runs last
            as long as their clips.
    """

    name: str
    recipes: tuple[tuple[str, ...], ...]
    targets: Target
    farthest_m: float | None
    steer: SteerSettings
    draws: int = 1
    reach_m: float | None = None
    timing: TimingSettings = TimingSettings()
    delay: DelaySettings = DelaySettings()
    head_start: HeadStartSettings = HeadStartSettings()
    line: LineSettings = LineSettings()
    search: CarefulSettings | None = None
    ends_early: bool = True

    @property
    def draws_from_parent(self) -> bool:
        """Return whether a campaign draws the mutants from the parent's run.

        A clip is then run without mutation only if a mutant of it failed. Only presets with a search do so; with the
        others, mutants are drawn from the clip's own run, as in the paper.
        """
        return self.search is not None


PAPER = MutationPreset(
    name="paper",
    # The paper says "For each child simulation, the Scenario Mutator applies a random steering angle", so every mutant
    # is steered.
    recipes=(("model_swap", "steer"),),
    targets="letter",
    farthest_m=None,
    steer=SteerSettings(),
    ends_early=False,
)
"""The settings of the paper (section 3.4). It does not state for how long an angle is held; here it is held to the
clip's end. `PAPER_LATE` and `PAPER_BRIEF` are other readings."""

PAPER_LATE = replace(PAPER, name="paper_late", steer=SteerSettings(before_point_s=1.0))
"""Another reading of the paper: the angle begins 1 s before the risky point, and is held to the clip's end."""

PAPER_BRIEF = replace(PAPER, name="paper_brief", steer=SteerSettings(hold_s=1.0))
"""A third reading of the paper: the angle is held for the first second of the clip; then the vehicle returns to its
lane."""

FOCUSED = MutationPreset(
    name="focused",
    # Ours. Steering finds most failures, but braking could have avoided hardly any of them; it could have avoided three
    # in five of those that changes of timing find (pilot). So each of the two gets half of the children. Recipes that
    # cannot act on a class are left out: the first four are, for a vehicle, steer, timing and both with a swap; for a
    # bicycle on a lane steer, timing, line and swap with steer; for a pedestrian timing, line, delay and head start.
    recipes=(
        ("steer",),
        ("timing",),
        ("line",),
        ("delay",),
        ("head_start",),
        ("model_swap", "steer"),
        ("timing", "line"),
        ("timing", "delay"),
        ("model_swap", "timing"),
    ),
    targets="ranked",
    farthest_m=45.0,
    draws=16,
    reach_m=0.5,  # the difference that slightly different steering or braking makes
    steer=SteerSettings(
        least_share=0.3,
        # With an onset at the clip's beginning, 108 of 117 failures came before the risky point (pilot).
        before_point_s=1.0,
        # In the pilot, holding the angle for 0.3 s had no effect, and 1 s had the same effect as the whole clip.
        hold_s=1.0,
        lateral_g=0.3,  # the strongest of ordinary drivers in an unhurried manoeuvre
        # 30 deg/s at the wheels: a steering wheel that is turned at 450 deg/s, with a steering ratio of 15.
        rate_rad_s=0.52,
        # At a lower speed, a second of steering moves an actor sideways by less than a hand's width.
        least_speed_mps=2.0,
    ),
)
"""Ours, the default of `foresee mutate`: it changes the ranked actor, one second before the risky point."""

AVOIDABLE = replace(FOCUSED, name="avoidable", search=CarefulSettings())
"""Ours, the default of a campaign: first changes that hit the recorded ego and that a careful driver could have
avoided, then changes as in `focused`."""

LAWFUL = replace(
    FOCUSED,
    name="lawful",
    recipes=(("style",), ("style", "timing"), ("style", "delay"), ("timing",), ("delay",), ("line",)),
    timing=TimingSettings(high=1.0),  # no faster than in the recorded run, which kept to the limits
)
"""Ours: opponents that keep the law and react to the ego; none is steered, swapped or faster than it was."""

HEAVY_WEATHER = replace(PAPER, name="heavy_weather", recipes=(("heavy_weather",),))
"""One child: heavy weather, without other changes (paper, section 4.4, RQ5)."""

PRESETS: Mapping[str, MutationPreset] = MappingProxyType(
    {p.name: p for p in (FOCUSED, PAPER, PAPER_LATE, PAPER_BRIEF, AVOIDABLE, LAWFUL, HEAVY_WEATHER)}
)
"""All presets by name. A study derives its own presets with `dataclasses.replace`, and passes the object instead of a
name."""


def preset(name: str | MutationPreset) -> MutationPreset:
    """Return the preset of a name; a preset object is returned unchanged."""
    if isinstance(name, MutationPreset):
        return name
    if name not in PRESETS:
        close = difflib.get_close_matches(name, PRESETS, n=1)
        hint = f"did you mean {close[0]!r}?" if close else f"known: {', '.join(PRESETS)}"
        raise UnknownPresetError(f"unknown preset {name!r} ({hint})")
    return PRESETS[name]

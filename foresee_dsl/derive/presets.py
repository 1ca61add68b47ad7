"""Presets: named sets of everything that the mutation operators leave to be chosen."""

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
    """There is no preset of that name."""


@dataclass(frozen=True, slots=True)
class SteerSettings:
    """Steering perturbations.

    Attributes:
        low, high: from -1 (right) to 1 (left) of the largest angle (paper, section 3.4).
        step: values are rounded to it.
        least_share: no value nearer to 0 than this share of what is allowed: it would do nothing.
        before_point_s: the onset, this long before the risky point; None for the clip's beginning.
        hold_s: how long it is held; None for the whole clip.
        lateral_g: the lateral acceleration that the steering alone may cause, in g; None for what the tyres hold.
        rate_rad_s: the front wheels must be able to reach the angle at this rate in half of `hold_s`; None for no such
            limit.
        least_speed_mps: a target slower than this at the onset is not steered.
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
    """Timing: the speed along one's own path, scaled.

    Attributes:
        low, high: the factor. Ours: within what drivers on one road differ by.
        step: values are rounded to it.
        least_change: no factor nearer to 1 than this. Ours: 0.05 shifts 5 s of driving by a quarter of a second.
        least_way_m: a target that drives less than this up to the risky point has no timing. Ours: a step's length.
    """

    low: float = 0.6
    high: float = 1.4
    step: float = 0.01
    least_change: float = 0.05
    least_way_m: float = 1.0


@dataclass(frozen=True, slots=True)
class DelaySettings:
    """Delay: how much longer a target stands before it moves.

    Attributes:
        low_s, high_s: ours; 1.5 s is an ordinary hesitation at a kerb, 0.2 s moves a walker by a foot's length.
        step_s: values are rounded to it (one step of the simulation).
    """

    low_s: float = 0.2
    high_s: float = 1.5
    step_s: float = 0.05


@dataclass(frozen=True, slots=True)
class HeadStartSettings:
    """Head start: how much further along its path a target is at the beginning.

    Attributes:
        low_s, high_s: it begins where it was so much later. Ours: 0.2 s moves a walker by a foot's length; with a
            second at most, four fifths of the way to the risky point are left.
        least_m: no head start under this: it would do nothing. Ours: half a walker's depth.
    """

    low_s: float = 0.2
    high_s: float = 1.0
    least_m: float = 0.2


@dataclass(frozen=True, slots=True)
class LineSettings:
    """Line: how far beside its own path a target walks or rides.

    Attributes:
        high_m: at most so far to either side. Ours: from the middle of a lane of 3.3 m, a bicycle 0.6 m wide comes
            within 0.35 m of the marking; a walker stays on a crossing of 4 m.
        step_m: values are rounded to it.
        least_m: none nearer to 0. Ours: half a bicycle's or walker's width.
    """

    high_m: float = 1.0
    step_m: float = 0.05
    least_m: float = 0.3


@dataclass(frozen=True, slots=True)
class Preset:
    """How clips are mutated.

    Attributes:
        recipes: the operators of one child each; child k takes recipe k modulo their number, of those all of whose
            operators can act on their targets (where there is none, what can act of each).
        targets: `letter`: model swap on the closest of the relevant actors, steering on the vehicle closest to the
            ego at the clip's beginning (paper, section 3.4). `ranked`: everything on the actor that the point is
            about, or where there is none (or one that nothing can act on) on the closest to the ego at the point.
        draws: of so many draws a child is the one whose roll-out comes nearest to the recorded ego; 1 for
            the first, whatever it does.
        reach_m: the ranked actor is left for the closest one that can where no draw brings it nearer than this to the
            ego (behind a fence no timing brings an actor near); None: it is not.
        farthest_m: a target farther from the ego than this at the risky point is not mutated; None for no limit.
        search: children are the best candidates of this search (`avoidance.candidates`), whoever behaves otherwise in
            them; the rest of this preset makes those that it leaves over. None: no search.
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


PAPER = Preset(
    name="paper",
    # "For each child simulation, the Scenario Mutator applies a random steering angle": every child is steered.
    recipes=(("model_swap", "steer"),),
    targets="letter",
    farthest_m=None,
    steer=SteerSettings(),
)
"""The letter of the paper (section 3.4). It does not print for how long an angle is held: here, to the clip's end."""

FOCUSED = Preset(
    name="focused",
    # Ours. Steering finds most, but nearly all of that no braking could have avoided; what timing finds, it could
    # three times in five (pilot): half of the children each. What cannot be done to a class is left out, so that the
    # first four are for a vehicle steer, timing and both with a swap; for a bicycle on a lane steer, timing, line and
    # swap with steer; for a pedestrian timing, line, delay and head start.
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
        before_point_s=1.0,  # at the clip's beginning, 108 of 117 failures came before the risky point (pilot)
        hold_s=1.0,  # 0.3 s does nothing, 1 s does what the whole clip does (pilot)
        lateral_g=0.3,  # the strongest that ordinary drivers do in an unhurried manoeuvre
        rate_rad_s=0.52,  # 30 deg/s at the wheels: a hand wheel turned with 450 deg/s through a ratio of 15
        least_speed_mps=2.0,  # slower, a second of steering moves it sideways by less than a hand
    ),
)
"""Ours, the default: the ranked actor, one second before the risky point."""

AVOIDABLE = replace(FOCUSED, name="avoidable", search=CarefulSettings())
"""Ours: first what hits the ego as it drove and a careful driver could have avoided; then as `focused`."""

HEAVY_WEATHER = Preset(
    name="heavy_weather", recipes=(("heavy_weather",),), targets="letter", farthest_m=None, steer=SteerSettings()
)
"""One child: the same in heavy weather, and nothing else is changed (paper, section 4.4, RQ5)."""

PRESETS: Mapping[str, Preset] = MappingProxyType({p.name: p for p in (FOCUSED, PAPER, AVOIDABLE, HEAVY_WEATHER)})
"""All presets by name. A study makes its own with `dataclasses.replace` and passes the object."""


def preset(name: str | Preset) -> Preset:
    """Return a preset by name; one that is given as such comes back."""
    if isinstance(name, Preset):
        return name
    if name not in PRESETS:
        close = difflib.get_close_matches(name, PRESETS, n=1)
        hint = f"did you mean {close[0]!r}?" if close else f"known: {', '.join(PRESETS)}"
        raise UnknownPresetError(f"unknown preset {name!r} ({hint})")
    return PRESETS[name]

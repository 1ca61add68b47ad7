"""Criticality of a run: the measures of `kernels.criticality` for the ego and another actor, at each frame.

There are two groups of measures. Those of a *contact* assume that both actors keep their speeds along their paths until
the footprints touch (`footprints.Contacts`): TTC, DRAC, BTN, time to brake, to steer and to react, delta-v and injury
risk; they have no value where no contact within `HORIZON_S` is predicted. Those of an actor *ahead* depend only on
where that actor is along the ego's path: time headway, and the margin to the distances of responsibility-sensitive
safety (RSS).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Self

import numpy as np

from foresee_dsl.compile.catalogue import CLASS_DEFAULTS
from foresee_dsl.kernels import criticality as formulas
from foresee_dsl.kernels.arrays import FloatArray
from foresee_dsl.kernels.boxes import IntArray
from foresee_dsl.kernels.constants import STANDS_MPS
from foresee_dsl.simulate.results.footprints import Contacts, Footprints, across, contacts_with, predicted
from foresee_dsl.simulate.trace import ACCELERATION, Trace

AHEAD_M = 100.0
"""An actor farther ahead than this along the ego's path has no time headway and no RSS margin, m. Ours: 7 s at 50
km/h."""
BESIDE_M = 10.0
"""An actor at most this far behind the ego's centre, along its path, counts as beside it, m. Ours: half a bus."""
SAME_WAY_RAD = math.radians(45)
"""Two actors drive in the same direction if their headings differ by less than this, and in opposite directions if they
differ by more than pi less this, rad. Ours: all other actors cross each other's way; RSS has separate rules for those,
which need the map."""
_EVERY_M = 1.0
"""Spacing of the points of the ego's path with which actors are compared at first, m; then the actors' place along the
path is computed exactly."""
ON_FOOT_OR_TWO_WHEELS = ("pedestrian", "bicycle")
"""Classes of actors whose injury risk is that of a pedestrian struck by a car; there is no published curve for
cyclists."""


class CriticalityMeasure(StrEnum):
    """A measure of criticality; the value is its name in documents and files.

    Attributes:
        words: its name in reports. unit: unit of its values; "" for shares. sign: 1 if large values are critical, -1 if
            small ones are.
        decimals: number of decimals in reports.
    """

    _value_: str
    words: str
    unit: str
    sign: int
    decimals: int

    def __new__(cls, value: str, words: str, unit: str, sign: int, decimals: int = 2) -> Self:
        """Make a member."""
        measure = str.__new__(cls, value)
        measure._value_, measure.words, measure.unit, measure.sign = value, words, unit, sign
        measure.decimals = decimals
        return measure

    TTC = "ttc_s", "time to collision", "s", -1
    DRAC = "drac_mps2", "braking needed", "m/s²", 1
    BTN = "btn", "brake threat number", "", 1
    TTB = "ttb_s", "time to brake", "s", -1
    TTS = "tts_s", "time to steer", "s", -1
    TTR = "ttr_s", "time to react", "s", -1
    THW = "thw_s", "time headway", "s", -1
    RSS = "rss_m", "margin to the RSS distance", "m", -1
    DELTA_V = "delta_v_mps", "delta-v", "m/s", 1
    RISK = "injury_risk", "injury risk", "", 1, 3


Series = Mapping[CriticalityMeasure, FloatArray]
"""The values of each measure, one for each frame."""


@dataclass(frozen=True)
class MeasureValues:
    """The values of all measures at some frames, [N] each; NaN where a measure has no value."""

    frames: IntArray
    values: Series


def criticality(trace: Trace, actor: int) -> Series:
    """Return all measures of the ego and an actor at each frame, [T] each; NaN where a measure has no value.

    Args:
        trace: a run. actor: column of the other actor.
    """
    run, frames = Footprints(trace), np.arange(trace.frames)
    values = {measure: np.full(trace.frames, np.nan) for measure in CriticalityMeasure}
    if trace.frames:
        for part in (
            of_contacts(run, actor, contacts_with(run, actor, frames, predicted(run, frames))),
            of_place(run, actor, frames),
        ):
            for measure, at_frames in part.values.items():
                values[measure][part.frames] = at_frames
    return values


def of_contacts(run: Footprints, actor: int, contacts: Contacts) -> MeasureValues:
    """Return the measures of predicted contacts with an actor."""
    frames, ttc, closing = contacts.frames, contacts.ttc_s, contacts.closing_mps
    own, other = run.speed[frames, 0], run.speed[frames, actor]
    pulls = run.trace.states[frames, actor, ACCELERATION] * np.cos(contacts.turned_rad)
    brake = formulas.time_to_brake(ttc, closing)
    steer = np.where(own < STANDS_MPS, np.nan, formulas.time_to_steer(ttc, contacts.aside_m))
    relative = np.sqrt(np.maximum(own**2 + other**2 - 2 * own * other * np.cos(contacts.turned_rad), 0.0))
    kind = run.trace.actors[actor].kind
    change = formulas.delta_v(relative, _mass_kg(run.trace.actors[0].kind), _mass_kg(kind))
    risk = (
        formulas.pedestrian_fatality_risk(relative)
        if kind in ON_FOOT_OR_TWO_WHEELS
        else formulas.serious_injury_risk(change)
    )
    braking = formulas.braking_required(ttc, closing, np.nan_to_num(pulls))
    return MeasureValues(
        frames,
        {
            CriticalityMeasure.TTC: ttc,
            CriticalityMeasure.DRAC: formulas.braking_required(ttc, closing, np.zeros(len(ttc))),
            CriticalityMeasure.BTN: formulas.brake_threat_number(braking),
            CriticalityMeasure.TTB: brake,
            CriticalityMeasure.TTS: steer,
            CriticalityMeasure.TTR: formulas.time_to_react(brake, steer),
            CriticalityMeasure.DELTA_V: change,
            CriticalityMeasure.RISK: risk,
        },
    )


def of_place(run: Footprints, actor: int, frames: IntArray) -> MeasureValues:
    """Return the measures of an actor ahead of or beside the ego, by its place along the ego's path."""
    ego, other = run.path(0), run.xy[:, actor]
    frames = frames[(run.apart[frames, actor - 1] <= AHEAD_M) & ~np.isnan(ego.along[frames])]  # False where absent
    if not frames.size:
        return MeasureValues(frames, {})
    here = ego.along[frames]
    marks = np.arange(max(float(here.min()) - BESIDE_M, 0.0), float(here.max()) + AHEAD_M, _EVERY_M)
    x, y = ego.places(marks)
    away = (x - other[frames, 0, None]) ** 2 + (y - other[frames, 1, None]) ** 2
    away[(marks < here[:, None] - BESIDE_M) | (marks > here[:, None] + AHEAD_M)] = np.inf
    nearest = away.argmin(axis=1)
    heading = ego.headings(marks[nearest])
    dx, dy = other[frames, 0] - x[nearest], other[frames, 1] - y[nearest]
    cos, sin = np.cos(heading), np.sin(heading)
    ahead, left = marks[nearest] + cos * dx + sin * dy - here, cos * dy - sin * dx
    turned = run.heading[frames, actor] - heading
    boxes = run.boxes(frames, actor)
    gap = ahead - (run.size[0, 0] + across(boxes, turned + math.pi / 2)) / 2
    beside = np.abs(left) - (run.size[0, 1] + across(boxes, turned)) / 2
    own, speed = run.speed[frames, 0], run.speed[frames, actor]
    stands, along = speed < STANDS_MPS, np.cos(turned)
    same = stands | (along >= math.cos(SAME_WAY_RAD))
    towards = ~stands & (along <= -math.cos(SAME_WAY_RAD))
    drives = own >= STANDS_MPS
    headway = formulas.time_headway(gap, run.trace.time_s, np.maximum.accumulate(np.nan_to_num(ego.along)), frames)
    far = gap - formulas.rss_distance(own, speed * along)
    nears = -np.sign(left) * speed * np.sin(turned)
    wide = beside - formulas.rss_lateral_distance(np.zeros(len(own)), nears)
    # A safe distance in one direction is enough. Where the lateral distance is too small, the longitudinal one decides.
    safe = np.where(wide < 0, far, np.maximum(far, wide))
    return MeasureValues(
        frames,
        {
            CriticalityMeasure.THW: np.where(same & drives & (beside < 0) & (gap >= 0), headway, np.nan),
            CriticalityMeasure.RSS: np.where((same | towards) & drives & (ahead > 0), safe, np.nan),
        },
    )


def _mass_kg(kind: str) -> float:
    """Return the usual mass of a class of actor, kg; an obstacle counts as fixed."""
    mass = next((defaults.mass_kg for name, defaults in CLASS_DEFAULTS.items() if name == kind), 0.0)
    return mass or math.inf

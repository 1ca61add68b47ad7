"""The opponent's part of a story: where it came from, the rule that it broke, when it became visible, its moments."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely

from foresee_dsl.compile.roads.polyline import wrap
from foresee_dsl.compile.roads.topology import Movement
from foresee_dsl.kernels.constants import STANDS_MPS
from foresee_dsl.language.model import Quantity
from foresee_dsl.simulate.trace import ACCELERATION, SPEED, STEP_S, X, Y
from foresee_dsl.story.contact import ALONG_RAD, moved_towards, side_of, steered_from, steering_of
from foresee_dsl.story.facts import Facts, spans
from foresee_dsl.story.place import StoryPlace, entries, movement_near
from foresee_dsl.story.sighting import Sighting, sighting_of
from foresee_dsl.story.story import ContactClass, Moment
from foresee_dsl.story.wording import full_name, kmh, metres, name_of

SUDDEN_S = 2.0
"""A hidden opponent that became visible less than this long before the end comes out of hiding, s: UN Regulation 157's
time to collision below which a cut-in is a risk (`avoidance.r157.risk`)."""
STARTED_WITHIN_S = 8.0
"""A vehicle beside the lanes that moved off less than this long before the end pulls out, s. Ours."""
SAME_LANE_M = 1.2
"""An opponent that drives in the ego's direction is ahead of the ego or behind it if its middle is less than this to
the ego's side, m; otherwise it is beside the ego. Ours: half a car and half a bicycle."""
APPROACH_S = 1.0
"""Away from junctions, the direction from which the opponent comes is read at this time before the end, s. Ours: before
most evasive manoeuvres."""
OPPONENT_BRAKES_MPS2 = 2.0
"""An opponent's braking weaker than this is left out, m/s^2. Ours: SUMO's drivers brake less to keep their distance."""


@dataclass(frozen=True, eq=False)
class Opponent:
    """The opponent of a run, and its behaviour in words.

    Attributes:
        facts: the run.
        actor: the opponent's column.
        place: where the run ended.
        contact: the class of the contact.
    """

    facts: Facts
    actor: int
    place: StoryPlace
    contact: ContactClass

    @cached_property
    def sighting(self) -> Sighting:
        """Return when the ego's sensors saw the opponent."""
        return sighting_of(self.facts, self.actor)

    @property
    def kind(self) -> str:
        """Return the opponent's class, such as `pedestrian`."""
        return self.facts.info(self.actor).kind

    @property
    def name(self) -> str:
        """Return the opponent's name and, unless the name states it, its class."""
        return full_name(self.facts.info(self.actor))

    @cached_property
    def sudden(self) -> bool:
        """Return whether the opponent became visible from behind something shortly before the end (`SUDDEN_S`)."""
        end_s = self.facts.trace.duration_s
        sighting = self.sighting
        return bool(sighting.hidden_by) and not sighting.from_start and sighting.before_s(end_s) < SUDDEN_S

    @cached_property
    def stands(self) -> bool:
        """Return whether the opponent has stood for the last second, or is an obstacle."""
        placed = self.facts.placed(self.actor)
        recent = self.facts.speed(self.actor)[max(0, self.facts.last - round(1 / STEP_S)) :]
        return (placed is not None and placed.control == "static") or bool((recent < STANDS_MPS).all())

    @cached_property
    def follows_path(self) -> bool:
        """Return whether the opponent follows a path of its own instead of SUMO's lanes."""
        return bool(self.facts.info(self.actor).path)

    @cached_property
    def movement(self) -> Movement | None:
        """Return the opponent's movement through the junction at which the run ends; None if it does not drive on
        SUMO's lanes there.
        """
        if self.follows_path or self.place.kind == "road":
            return None
        return movement_near(self.facts, self.actor, self.facts.last, self.place)

    @cached_property
    def relation(self) -> str:
        """Return, in words, where the opponent came from relative to the ego, before both reached the place where the
        run ends.
        """
        facts = self.facts
        if self.kind == "pedestrian":
            return _across(facts.relative_course(self.actor, facts.last), "walks")
        frame, ego_heading = self._approach(0)
        if self.follows_path:
            heading = facts.course(self.actor, _first_moving(facts, self.actor, frame))
            if self.onto_road is not None and ALONG_RAD < abs(wrap(heading - ego_heading)) < math.pi - ALONG_RAD:
                return _across(wrap(heading - ego_heading), "rides" if self.kind == "bicycle" else "drives")
        else:
            heading = self._approach(self.actor)[1]
        turned = wrap(heading - ego_heading)
        if abs(turned) < ALONG_RAD:
            return self._beside(frame)
        if abs(turned) > math.pi - ALONG_RAD:
            return "comes the other way"
        return "comes from the right" if turned > 0 else "comes from the left"

    @cached_property
    def breaks_rule(self) -> str:
        """Return, in words, the rule that the opponent breaks: a red signal or the ego's right of way; "" if
        neither.
        """
        if self.movement is None:
            return ""
        start = self._entry
        if start is None:
            return ""
        if self.facts.colour(self.movement, max(0, start - 1)) == "red":
            return "on red"
        ego = movement_near(self.facts, 0, self.facts.last, self.place)
        junction = self.facts.network.junctions.get(self.movement.junction)
        if ego is None or junction is None or ego.junction != self.movement.junction:
            return ""
        mine, its = ego.index, self.movement.index
        return "without giving way" if junction.yields(its, mine) and not junction.yields(mine, its) else ""

    @cached_property
    def manoeuvre(self) -> str:
        """Return the opponent's manoeuvre in words; two runs with equal stories have the same words."""
        if self.stands:
            return "stands"
        parts = ["pulls out" if self.pulls_out else self.relation]
        if self.movement is not None and self.movement.turn in ("left", "right"):
            parts.append(f"turns {self.movement.turn}")
        if self.steered:
            parts.append("is steered towards the ego")
        elif self.breaks_rule:
            parts.append(self.breaks_rule)
        if self.sudden:
            parts.append("out of hiding")
        return ", ".join(parts)

    @cached_property
    def steered(self) -> bool:
        """Return whether the mutation turned the opponent's wheels towards the ego, or made it strike the ego."""
        change = steering_of(self.facts)
        by_wheel = change is not None and change.property == "steer" and moved_towards(self.facts)
        return by_wheel or self.contact is ContactClass.STRUCK_BY_STEERED

    @cached_property
    def pulls_out(self) -> bool:
        """Return whether the opponent is a vehicle that stood beside the lanes and has just moved off
        (`STARTED_WITHIN_S`).
        """
        if self.kind in ("pedestrian", "bicycle") or not self.follows_path:
            return False
        first = max(0, self.facts.last - round(STARTED_WITHIN_S / STEP_S))
        return bool((self.facts.speed(self.actor)[first:] < STANDS_MPS).any())

    @cached_property
    def onto_road(self) -> int | None:
        """Return the first frame from which the opponent's middle stays on the road.

        None if it was always there, or is not there at the end.
        """
        if not self.follows_path:
            return None
        on_road = self._on_road
        off = np.flatnonzero(~on_road)
        return int(off[-1]) + 1 if off.size and off[-1] < self.facts.last else None

    def ahead_m(self, frame: int) -> float:
        """Return the gap between the footprints of opponent and ego at a frame, m."""
        return self.facts.gap_m(self.actor, frame)

    def clause(self) -> str:
        """Return what the opponent did, as the main clause of the story's sentence."""
        if self.stands:
            return f"{self.name} stands"
        hiding = f" from behind {self.sighting.hidden_by}," if self.sudden else ""
        what = self._comes()
        if hiding:
            comes, _, side = what.partition(" from the ")
            what = f"{comes}{hiding}" + (f" from the {side}" if side else "").removesuffix(",")
        parts = [f"{self.name} {what.rstrip(',')}"]
        if self.breaks_rule:
            parts[0] += f"{',' if hiding else ''} {self.breaks_rule}"
        if self.steered:
            parts[0] += f" and is steered {self._steered_side} into the ego's way"
        gap = self._gap_words()
        return ", ".join([*parts, gap] if gap else parts)

    def moments(self) -> Iterator[Moment]:
        """Yield the moments of the opponent."""
        facts, name = self.facts, name_of(self.facts.info(self.actor))
        if self.sighting.since_s is not None and not self.sighting.from_start:
            again = f" since {self.sighting.lost_s:.2f} s" if self.sighting.lost_s is not None else " until then"
            hidden = f", hidden by {self.sighting.hidden_by}{again}" if self.sighting.hidden_by else ""
            gap = metres(self.ahead_m(round(self.sighting.since_s / STEP_S)))
            sees = f"sees {self.name}{' again' if self.sighting.again else ''}, {gap} away"
            yield Moment(self.sighting.since_s, facts.info(self.actor).id, "appears", f"the ego {sees}{hidden}")
        elif self.sighting.since_s is None:
            by = f", hidden by {self.sighting.hidden_by}" if self.sighting.hidden_by else ""
            lost_s = self.sighting.lost_s
            frame = facts.last if lost_s is None else round(lost_s / STEP_S) + 1
            verb = "does not see" if lost_s is None else "loses sight of"
            yield self._moment(frame, "unseen", f"the ego {verb} {self.name}{by}")
        change = steering_of(facts)
        if change is not None and change.property == "steer" and isinstance(change.start, Quantity):
            yield self._moment(round(change.start.si / STEP_S), "steered", f"{name} is steered {self._steered_side}")
        speed = facts.speed(self.actor)
        for _, end in spans(speed < STANDS_MPS, 0.5):
            if end < facts.last:
                yield self._moment(end + 1, "moves off", f"{name} moves off")
        if self.onto_road:
            on = self.onto_road
            verb = "steps" if self.kind == "pedestrian" else "rides" if self.kind == "bicycle" else "drives"
            yield self._moment(
                on, "onto the road", f"{name} {verb} onto the road, {metres(self.ahead_m(on))} from the ego"
            )
        yield from self._driven()

    def _driven(self) -> Iterator[Moment]:
        facts, name = self.facts, name_of(self.facts.info(self.actor))
        for start, where in () if self.follows_path else entries(facts, self.actor):
            yield self._moment(start, "enters", f"{name} enters {where}, {metres(self.ahead_m(start))} from the ego")
        states = facts.trace.states[:, self.actor]
        with np.errstate(invalid="ignore"):
            braking = (states[:, ACCELERATION] <= -OPPONENT_BRAKES_MPS2) & (states[:, SPEED] > STANDS_MPS)
        for start, end in spans(braking, 0.3, 0.3) if self.kind != "pedestrian" else ():
            strongest = -float(np.nanmin(states[start : end + 1, ACCELERATION]))
            yield self._moment(start, "brakes", f"{name} brakes with {strongest:.1f} m/s^2")

    @property
    def _steered_side(self) -> str:
        change = steering_of(self.facts)
        return "to its left" if change is not None and side_of(change) > 0 else "to its right"

    @cached_property
    def _on_road(self) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        states = self.facts.trace.states[:, self.actor]
        return np.asarray(shapely.contains_xy(self.facts.network.drivable, states[:, X], states[:, Y]), dtype=np.bool_)

    def _approach(self, actor: int) -> tuple[int, float]:
        """Return the last frame before an actor entered the junction where the run ends, and its heading then.

        Away from junctions: the frame `APPROACH_S` before the end, or the frame at which it was steered if earlier.
        """
        facts, near = self.facts, self.place.kind != "road"
        passages = [p for p in facts.passages(actor) if near and p[2].junction == self.place.junction]
        if passages:
            start, _, movement = passages[-1]
            if start > 0:
                return start - 1, facts.heading(actor, start - 1)
            lane = facts.network.lanes.get(movement.from_lane)
            return 0, lane.line.angles[-1] if lane else facts.heading(actor, 0)
        frame = max(0, facts.last - round(APPROACH_S / STEP_S))
        change = steering_of(facts)
        if change is not None and change.property == "steer":
            frame = min(frame, steered_from(change))
        present = np.flatnonzero(~np.isnan(facts.trace.states[:, actor, X]))
        frame = max(frame, int(present[0])) if present.size else frame
        return frame, facts.heading(actor, frame)

    def _beside(self, frame: int) -> str:
        ahead, left = self.facts.seen_from_ego(self.actor, frame)
        if abs(left) < SAME_LANE_M:
            return "is ahead of the ego" if ahead > 0 else "comes from behind"
        verb = "rides" if self.kind == "bicycle" else "drives"
        return f"{verb} beside the ego on its {'left' if left > 0 else 'right'}"

    def _comes(self) -> str:
        """Return where the opponent came from and where it went, as a predicate."""
        if self.pulls_out:
            left = self.facts.seen_from_ego(self.actor, self._moved_off)[1]
            return f"pulls out from the {'left' if left > 0 else 'right'}"
        what, crossing = self.relation, self.place.text if self.place.kind == "crossing" else ""
        if self.kind == "pedestrian" and crossing:
            return what.replace("walks", f"walks onto {crossing}", 1)
        if crossing:
            return f"{what} and on over {crossing}"
        if self.onto_road is not None:
            what = what.replace("walks from", "steps onto the road from", 1)
            what = what.replace("rides from", "rides onto the road from", 1)
            what = what.replace("drives from", "drives onto the road from", 1)
        turn = self.movement.turn if self.movement is not None else ""
        return what + (f" and turns {turn}" if turn in ("left", "right") else "")

    def _gap_words(self) -> str:
        """Return, in words, how far from the ego the opponent was when its manoeuvre began, and the ego's speed then;
        "" if unclear.
        """
        frame = self._onset
        if frame is None or frame <= 0 or (self.facts.last - frame) * STEP_S < 0.2:
            return ""
        gap, speed = self.ahead_m(frame), float(self.facts.speed(0)[frame])
        along = self.facts.seen_from_ego(self.actor, frame)[0] - self.facts.info(0).front_m
        how = f"the ego at {kmh(speed)}" if speed >= STANDS_MPS else "the standing ego"
        return f"{metres(gap)} {'ahead of' if along > gap / 2 else 'from'} {how}"

    def came_to_a_standing_ego(self, stood_s: float) -> bool:
        """Return whether its manoeuvre began while the ego, which has stood for `stood_s` at the end, stood already."""
        return self._onset is not None and (self.facts.last - self._onset) * STEP_S <= stood_s

    @cached_property
    def began(self) -> int | None:
        """Return the frame at which the opponent began what led to the end; None if it only continued as before.

        That is when it was steered, or else the earliest frame at which it moved off, came onto the road or entered the
        junction.
        """
        if self.steered:
            return self._onset
        standing = self._moved_off if self.follows_path else 0
        return standing if standing else self._onset

    @property
    def _onset(self) -> int | None:
        """Return the frame at which the opponent's manoeuvre began: it was steered, came onto the road or moved off.

        None if none of these happened.
        """
        change = steering_of(self.facts)
        if self.steered:
            return steered_from(change) if change is not None and change.property == "steer" else None
        if self.pulls_out:
            return self._moved_off
        if " beside " in self.relation:
            return None
        return self.onto_road if self.follows_path else self._entry

    @property
    def _moved_off(self) -> int:
        """Return the last frame at which the opponent stood; 0 if it never did."""
        standing = np.flatnonzero(self.facts.speed(self.actor) < STANDS_MPS)
        return int(standing[-1]) if standing.size else 0

    @cached_property
    def _entry(self) -> int | None:
        """Return the frame at which the opponent enters the junction where the run ends; None if it has no movement
        through it.
        """
        if self.movement is None:
            return None
        passages = self.facts.passages(self.actor)
        return next((start for start, _, m in passages if m.junction == self.movement.junction), None)

    def _moment(self, frame: int, kind: str, text: str) -> Moment:
        return Moment(round(frame * STEP_S, 6), self.facts.info(self.actor).id, kind, text)


def _first_moving(facts: Facts, actor: int, frame: int) -> int:
    """Return `frame` if an actor moves then, else the frame a second after it first moves, within the run."""
    moving = np.flatnonzero(facts.speed(actor)[frame:] >= STANDS_MPS)
    first = frame + int(moving[0]) if moving.size else frame
    return first if first == frame else min(first + round(1 / STEP_S), facts.last)


def _across(turned: float, verb: str) -> str:
    if abs(turned) < ALONG_RAD:
        return f"{verb} ahead in the same direction"
    if abs(turned) > math.pi - ALONG_RAD:
        return f"{verb} towards the ego"
    return f"{verb} from the right" if turned > 0 else f"{verb} from the left"

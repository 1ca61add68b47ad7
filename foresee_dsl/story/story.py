"""The story of a run as immutable records: moments with times, one sentence, and the words by which stories are
compared.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from foresee_dsl.documents import or_null, rounded


class ContactClass(StrEnum):
    """Classes of contacts that a person who reviews failures judges differently."""

    HIT_WHILE_STANDING = "hit while standing"
    """The ego stood, and the opponent moved."""
    STRUCK_BY_STEERED = "struck by somebody steered into it"
    """The mutation moved the opponent's line or wheels, and the opponent struck the ego."""
    EGO_DROVE_INTO = "ego drove into"
    """The ego moved towards the opponent, and the opponent did not move towards the ego."""
    BOTH_MOVING = "both moving"
    """Both moved, and the opponent moved towards the ego (or both did, or they touched in passing)."""
    OFF_ROAD = "off the road"
    """The ego left the drivable area."""
    RULE = "broke a traffic rule"
    """The ego broke a traffic rule in a run that passed otherwise."""
    GOAL = "broke the goal"
    """The ego broke the goal of its campaign in a run that passed otherwise."""
    NONE = "no contact"
    """The ego got stuck, was late or passed."""


@dataclass(frozen=True)
class Moment:
    """An event at a moment of a run.

    Attributes:
        time_s: time since the run's first frame, s.
        actor: id of the actor that did it.
        kind: one word for it (`brakes`, `appears`, `contact`, ...).
        text: what happened, with the actor's name and without the time.
    """

    time_s: float
    actor: str
    kind: str
    text: str

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {"time_s": rounded(self.time_s, 2), "actor": self.actor, "kind": self.kind, "text": self.text}


LOOKS_BACK_S = 10.0
"""The search for when the ego sees the opponent goes back this far from the end, s. Ours: nearly all relevant times to
collision are shorter, and by default a clip is 10 s long at most."""


def seen_for(time_s: float) -> str:
    """Return in words for how long an actor was in sight, as far as that was searched."""
    return f"{time_s:.1f} s" if time_s < LOOKS_BACK_S else f"{LOOKS_BACK_S:.0f} s or longer"


@dataclass(frozen=True)
class Grounds:
    """The facts that a judgement of a failure needs; the times count back from the end of the run.

    Attributes:
        stood_s: how long the ego had stood, s. braked_s: how long it had been braking, s; 0 if it did not brake.
        seen_s: how long its sensors had seen the opponent without a break, s, at most `LOOKS_BACK_S`; 0 if they did
            not see it.
        seen_before: they had seen it already before it was hidden for a time.
        acts_s: how long ago the opponent's last manoeuvre began (it moved off, came onto the road, entered the
            junction, was steered), s; None if it only went on as before.
        steered: the mutation steered the opponent into the ego. stands: the opponent stands.
        breaks_rule: the rule that the opponent breaks, in words; "" if none.
        gives_way: the rule by which the ego had to give way to the opponent, in words; "" if none.
        hidden_by: what hid the opponent from the ego just before it came into sight, in words; "" if nothing did.
        signal: the junction with a signal that the ego entered last, and its colour then: `king_elm green`; "" if none.
    """

    stood_s: float = 0.0
    braked_s: float = 0.0
    seen_s: float = 0.0
    seen_before: bool = False
    acts_s: float | None = None
    steered: bool = False
    stands: bool = False
    breaks_rule: str = ""
    gives_way: str = ""
    hidden_by: str = ""
    signal: str = ""


@dataclass(frozen=True)
class Story:
    """The story of a run.

    Attributes:
        moments: the moments in the order of time. sentence: the whole story in one sentence.
        opponent: id of the actor that the story is about; "" if it is about the ego alone.
        opponent_kind: its class (`pedestrian`, `car`, ...), "" for none.
        contact: the class of the contact.
        ego_manoeuvre, opponent_manoeuvre: what each was doing, in words that all equal stories share.
        place: where in the road layout the run ended, also in words that all equal stories share.
        touch: the side of the ego that was touched first; "" without a contact, or if the side is a matter of chance.
        mutation: what the mutation changed, in words; "" without a mutation.
        title: the story in at most twelve words. grounds: the facts by which a failure is judged.
    """

    moments: tuple[Moment, ...]
    sentence: str
    opponent: str
    opponent_kind: str
    contact: ContactClass
    ego_manoeuvre: str
    opponent_manoeuvre: str
    place: str
    touch: str = ""
    mutation: str = ""
    title: str = ""
    grounds: Grounds = Grounds()

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        return {
            "sentence": self.sentence,
            "class": self.contact,
            "opponent": or_null(self.opponent),
            "opponent_kind": or_null(self.opponent_kind),
            "ego_manoeuvre": self.ego_manoeuvre,
            "opponent_manoeuvre": self.opponent_manoeuvre,
            "place": self.place,
            "touch": or_null(self.touch),
            "mutation": or_null(self.mutation),
            "moments": self.moments,
        }

    @property
    def role(self) -> str:
        """Return the class of the opponent, where all motor vehicles are one class."""
        return self.opponent_kind if self.opponent_kind in ("", "pedestrian", "bicycle", "obstacle") else "vehicle"

    @property
    def signature(self) -> tuple[str, ...]:
        """Return the words that decide whether two stories are equal."""
        manoeuvres = self.ego_manoeuvre, self.opponent_manoeuvre
        return (self.role, *manoeuvres, self.place, self.contact.value, self.touch)

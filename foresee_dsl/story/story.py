"""What happened in a run, as immutable records: moments with times, one sentence, and what makes two stories equal."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class ContactClass(StrEnum):
    """Classes of endings that people treat differently."""

    HIT_WHILE_STANDING = "hit while standing"
    """The ego stood, and the other moved."""
    STRUCK_BY_STEERED = "struck by somebody steered into it"
    """The mutation moved the other's line or wheel, and the other did the striking."""
    EGO_DROVE_INTO = "ego drove into"
    """The ego moved towards the other, and the other did not move towards the ego."""
    BOTH_MOVING = "both moving"
    """Both moved, and the other moved towards the ego (or both did, or they touched in passing)."""
    OFF_ROAD = "off the road"
    """The ego left the drivable area."""
    NONE = "no contact"
    """Stuck, late, passed."""


@dataclass(frozen=True)
class Moment:
    """Something that began at a moment of a run.

    Attributes:
        time_s: when, from the run's first frame. actor: the id of who did it.
        kind: what it is, in one word (`brakes`, `appears`, `contact`, ...). text: in words, with the actor's name and
            without the time.
    """

    time_s: float
    actor: str
    kind: str
    text: str

    shown = "time_s:2 actor kind text"


@dataclass(frozen=True)
class Story:
    """What happened in a run.

    Attributes:
        moments: in the order of time. sentence: all of it in one sentence, for people.
        opponent: the id of the actor that the story is about, "" where it is about the ego alone.
        opponent_kind: its class (`pedestrian`, `car`, ...), "" for none.
        contact: the class of its ending.
        ego_manoeuvre, opponent_manoeuvre: what each was doing, in words that are the same in equal stories.
        place: where in the road layout, likewise.
        touch: the kind of contact, likewise: which side of the ego was touched first; "" without a contact and where
            that is a matter of chance.
        mutation: what the mutation changed, in words; "" where there is none.
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

    shown = (
        "sentence class=contact opponent? opponent_kind? ego_manoeuvre opponent_manoeuvre place touch? mutation? "
        "moments"
    )

    @property
    def role(self) -> str:
        """What the opponent is in the story: its class, with all motor vehicles in one."""
        return self.opponent_kind if self.opponent_kind in ("", "pedestrian", "bicycle", "obstacle") else "vehicle"

    @property
    def signature(self) -> tuple[str, ...]:
        """What equal stories have in common."""
        manoeuvres = self.ego_manoeuvre, self.opponent_manoeuvre
        return (self.role, *manoeuvres, self.place, self.contact.value, self.touch)

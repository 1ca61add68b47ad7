"""A campaign's file: which test cases, driven by whom, clipped and mutated how, and for how long."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from foresee_dsl.language.model.network import Doc
from foresee_dsl.language.model.values import ONE_OF, FilePath, Id, Item, Name, Quantity, has_dimension

Time = Annotated[Quantity, AfterValidator(has_dimension("time"))]
Count = Annotated[Quantity, AfterValidator(has_dimension("count"))]
"""A campaign has no parameters, so its values are numbers."""


class Seeds(Item):
    """`seeds "scenarios/**"`: test cases, by file, folder, pattern or address (`"runner.foresee::r01"`), from the
    campaign's folder; said again for more."""

    kind: Literal["seeds"] = "seeds"
    path: FilePath


class Drivers(Item):
    """`drivers [pdm, "external:python3 mine.py"]`: who drives; everything is done with each (default: pdm)."""

    kind: Literal["drivers"] = "drivers"
    names: tuple[Id, ...] = Field(min_length=1)


class Rankers(Item):
    """`rankers [foresee, proximity]`: who picks the risky points; the clips of each are made (default: foresee)."""

    kind: Literal["rankers"] = "rankers"
    names: tuple[Id, ...] = Field(min_length=1)


class Preset(Item):
    """`preset focused`: how clips are mutated."""

    kind: Literal["preset"] = "preset"
    name: Name


class ClipAround(Item):
    """`clip before 5 s after 5 s`: what is cut out around a risky point."""

    kind: Literal["clip_around"] = "clip_around"
    before: Time
    after: Time


class RiskyPoints(Item):
    """`risky_points 4`: how many of a run, at most."""

    kind: Literal["risky_points"] = "risky_points"
    count: Count


class Children(Item):
    """`children 4`: mutants of a clip."""

    kind: Literal["children"] = "children"
    count: Count


class Repeat(Item):
    """`repeat 3`: clips are mutated anew so often, with the seeds that follow the first."""

    kind: Literal["repeat"] = "repeat"
    times: Count


class FirstSeed(Item):
    """`seed 7`: what every lot that is drawn comes from."""

    kind: Literal["first_seed"] = "first_seed"
    seed: Count


class Budget(Item):
    """`budget 30 min`: no new run begins later than that after the start."""

    kind: Literal["budget"] = "budget"
    time: Time


CampaignItem = Annotated[
    Doc | Seeds | Drivers | Rankers | Preset | ClipAround | RiskyPoints | Children | Repeat | FirstSeed | Budget, ONE_OF
]


class Campaign(Item):
    """`campaign nightly { seeds "scenarios/**"; drivers [pdm]; budget 30 min }`: what `foresee campaign FILE` does."""

    kind: Literal["campaign"] = "campaign"
    name: Name
    body: tuple[CampaignItem, ...]

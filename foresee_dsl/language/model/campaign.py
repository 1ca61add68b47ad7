"""The campaign file: its test cases, drivers, clipping and mutation settings, and time budget.

A statement that sets one of `campaign.settings.CampaignSettings` says which: `sets` maps its fields to the settings.
"""

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from foresee_dsl.language.campaign_values import AROUND_S, CHILDREN_BOUNDS, REPEAT, RISKY_POINTS, SEED
from foresee_dsl.language.model.item import ONE_OF, Block, Bounds, Item
from foresee_dsl.language.model.network import Doc
from foresee_dsl.language.model.values import FilePath, Id, Name, OfDimension, Quantity

_Time = Annotated[Quantity, OfDimension("time")]
_Count = Annotated[Quantity, OfDimension("count")]
_Around = Annotated[_Time, Bounds(*AROUND_S)]
"""A campaign has no parameters, so its values are plain numbers."""


class Seeds(Item):
    """`seeds "scenarios/**"`: the test cases of a campaign, by file, folder, pattern or address
    (`"runner.foresee::r01"`), from the campaign's folder; a campaign may have several such statements."""

    pattern = "seeds {path}"
    words = 'seeds (statement): the test cases of a campaign: a file, folder, pattern or address | seeds "scenarios/**"'

    path: FilePath


class Drivers(Item):
    """`drivers [pdm, "external:python3 mine.py"]`: the drivers under test, each of which is tested in every step
    (default: pdm)."""

    pattern = "drivers {names}"
    words = "drivers (statement): the drivers that a campaign tests | drivers [pdm, idm]"

    names: tuple[Id, ...] = Field(min_length=1)


class Rankers(Item):
    """`rankers [foresee, proximity]`: the rankers, each of which chooses the risky points that are clipped (default:
    reach)."""

    pattern = "rankers {names}"
    words = "rankers (statement): the methods that choose the risky points of a campaign | rankers [foresee]"

    names: tuple[Id, ...] = Field(min_length=1)


class Against(Item):
    """`against [idm, "pdm+ideal"]`: the reference drivers, which drive every failure too; `against [none]`: no
    reference driver."""

    pattern = "against {names}"
    words = "against (statement): reference drivers, which drive every failure of a campaign too | against [idm]"

    names: tuple[Id, ...] = Field(min_length=1)


class Preset(Item):
    """`preset focused`: how clips are mutated."""

    pattern = "preset {name}"
    words = "preset (setting): the settings by which clips are mutated | preset focused"

    sets: ClassVar[Mapping[str, str]] = {"name": "preset"}
    name: Name


class ClipAround(Item):
    """`clip before 5 s after 5 s`: length of a clip before and after its risky point."""

    pattern = "clip before {before} after {after}"

    sets: ClassVar[Mapping[str, str]] = {"before": "before_s", "after": "after_s"}
    before: _Around
    after: _Around


class RiskyPoints(Item):
    """`risky_points 4`: maximum number of risky points per run."""

    pattern = "risky_points {count}"
    words = """
        risky_points (statement): the maximum number of risky points per run of which clips are cut | risky_points 4
    """

    sets: ClassVar[Mapping[str, str]] = {"count": "risky_points"}
    count: Annotated[_Count, Bounds(*RISKY_POINTS)]


class Children(Item):
    """`children 4`: number of mutants per clip."""

    pattern = "children {count}"
    words = "children (statement): the number of mutants per clip | children 4"

    sets: ClassVar[Mapping[str, str]] = {"count": "children"}
    count: Annotated[_Count, Bounds(*CHILDREN_BOUNDS)]


class Repeat(Item):
    """`repeat 3`: how many times each clip is mutated, each time with the next seed."""

    pattern = "repeat {times}"
    words = "repeat (statement): how many times each clip is mutated, each time with the next seed | repeat 3"

    sets: ClassVar[Mapping[str, str]] = {"times": "repeat"}
    times: Annotated[_Count, Bounds(*REPEAT)]


class Allocation(Item):
    """`allocation adaptive`: clips whose mutants failed more often get more mutants; `allocation stories`: mutants go
    where they may still add a story; `allocation even`: all clips get the same number."""

    pattern = "allocation {how}"
    words = """
        allocation (statement): how a campaign distributes the mutants over the clips | allocation adaptive
        even (constant): all clips get the same number of mutants | allocation even
        adaptive (constant): clips whose mutants failed more often get more mutants | allocation adaptive
        stories (constant): mutants go where they may still add a story, or an avoidable failure | allocation stories
    """

    sets: ClassVar[Mapping[str, str]] = {"how": "allocation"}
    how: Literal["even", "adaptive", "stories"]


class SearchGoal(Item):
    """`goal room`: the expectation that the campaign searches, by its label: its margin decides what is studied, and a
    run that breaks it fails."""

    pattern = "goal {name}"

    sets: ClassVar[Mapping[str, str]] = {"name": "goal"}
    name: Name


class Rules(Item):
    """`rules report`: a run in which the ego breaks a traffic rule passes, and the break is reported; `rules off`: the
    rules are not judged; `rules fail`: such a run fails."""

    pattern = "rules {mode}"
    words = """
        rules (statement): what it means in a campaign that the ego breaks a traffic rule | rules report
        fail (constant): a run in which the ego breaks a traffic rule fails | rules fail
        report (constant): broken traffic rules are reported, and fail no run | rules report
        off (constant): traffic rules are not judged | rules off
    """

    sets: ClassVar[Mapping[str, str]] = {"mode": "rules"}
    mode: Literal["fail", "report", "off"]


class FirstFrom(Item):
    """`first_from "out/idm"`: a folder of an earlier campaign, or of kept failures, from the campaign's folder: mutants
    that failed there are run first, in clips of the same test case."""

    pattern = "first_from {path}"
    words = """
        first_from (statement): an earlier campaign or kept failures, whose failing mutants are run first
            | first_from "out/idm"
    """

    sets: ClassVar[Mapping[str, str]] = {"path": "first_from"}
    path: FilePath


class FirstSeed(Item):
    """`seed 7`: the seed of all random choices."""

    pattern = "seed {seed}"

    sets: ClassVar[Mapping[str, str]] = {"seed": "seed"}
    seed: Annotated[_Count, Bounds(*SEED)]


class Budget(Item):
    """`budget 30 min`: no new run begins later than this after the start."""

    pattern = "budget {time}"
    words = "budget (statement): no new run of a campaign begins later than this after its start | budget 30 min"

    time: Annotated[_Time, Bounds(0.0)]


CampaignItem = Annotated[
    Doc
    | Seeds
    | Drivers
    | Against
    | Rankers
    | Preset
    | ClipAround
    | RiskyPoints
    | Children
    | Repeat
    | Allocation
    | SearchGoal
    | Rules
    | FirstFrom
    | FirstSeed
    | Budget,
    ONE_OF,
]


class Campaign(Block):
    """`campaign nightly { seeds "scenarios/**"; drivers [pdm]; budget 30 min }`: the campaign that `foresee campaign
    FILE` runs."""

    pattern = "campaign {name} { ...body }"
    words = """
        campaign (definition): a campaign: which test cases are run, clipped and mutated, and how
            | campaign nightly { ... }
    """

    name: Name
    body: tuple[CampaignItem, ...]

"""Settings of a campaign, which its report shows; parts of a campaign; limits of its runs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

from foresee_dsl.drivers.deadlines import Deadlines
from foresee_dsl.language.campaign_values import (
    AROUND_S,
    CHILDREN_BOUNDS,
    DEFAULT_AROUND_S,
    DEFAULT_CHILDREN,
    REPEAT,
    RISKY_POINTS,
    RULES_MODE,
    RulesMode,
)

Allocation = Literal["even", "adaptive", "stories"]
FIRST = 1
"""Number of mutants per clip and seed in the first round."""


class SettingOption(NamedTuple):
    """The option of a setting on the command line.

    Attributes:
        help: its text in `--help`. low, high: the bounds of its values, None without bounds.
        metavar: what stands for its value in `--help`; "" for the name of its type.
        shows_default: whether `--help` shows the default.
        by_driver: without the option, the command asks the driver; its default is then None, not that of the setting.
    """

    help: str
    low: float | None = None
    high: float | None = None
    metavar: str = ""
    shows_default: bool = True
    by_driver: bool = False


OPTION = "option"
"""Key of a field's metadata: its `SettingOption`; None for a setting without one."""


def option(
    help_: str, bounds: tuple[float | None, float | None] = (None, None), *, metavar: str = "",
    shows_default: bool = True, by_driver: bool = False,
) -> Mapping[str, SettingOption]:  # fmt: skip
    """Return the metadata of a setting's field: its option, see `SettingOption`."""
    return {OPTION: SettingOption(help_, *bounds, metavar, shows_default, by_driver)}


@dataclass(frozen=True)
class CampaignSettings:
    """Settings of a campaign.

    Clips of 10 s and four mutants per clip are the paper's best configuration (section 4.5, RQ1). The ranker `reach`
    and the preset `avoidable` are ours: together, with four points, they have 2.9 times as many findings in the same
    simulated time as the paper's ranker and preset (docs/background/study.md#the-default-search). Several drivers or
    rankers need several settings, which share their common runs in one store.

    Each field is declared once, with its option of `foresee campaign` and `foresee plan`; the options that other
    commands have too are `cli.options.campaign_options.SHARED`. The bounds are also those of the campaign file's
    statements, which name the settings that they set (`language.model.campaign`).

    Attributes:
        before_s, after_s: o_b and o_a, seconds of a clip before and after its risky point.
        risky_points: n_rp, maximum number of risky points per run; points with the same clip count once. Ours: with
            `reach` the paper's fourth point has 1 of 59 findings of the even half and takes a fifth of the time.
        children: c, number of mutants per clip.
        seed: seed of all random choices.
        fidelity_limit_m: a clip whose unmutated run deviates further from its parent is not mutated (ours: half a
            lane's free width beside a car, 0.75 m; beyond it the clip is another situation).
        handover_s: duration at a clip's beginning in which the ego follows its recorded states while the driver
            watches. The command line's default is the driver's request (`drivers.registry.handover_of`).
        repeat: number of times clips are mutated, with `seed` and the seeds after it.
        against: the reference drivers, which also drive every failing mutant.
        allocation: `even`: each clip gets `children`. `adaptive`: the same total in rounds; clips whose mutants were
            worth more get more. `stories`: the same total in rounds; mutants go where they may still add a story.
        rules: what it means that the ego breaks a traffic rule in a run that passes otherwise.
        first_from: folder whose failing mutants are run first, in the clips of the same test case; "": none.
        goal: label of the expectation that the campaign searches: its margin decides what is studied, and a run that
            breaks it fails. "": collisions and other failures are searched.
    """

    driver: str = "pdm"
    ranker: str = "reach"
    preset: str = "avoidable"
    before_s: float = field(
        default=DEFAULT_AROUND_S, metadata=option("Seconds of a clip before its risky point.", AROUND_S)
    )
    after_s: float = field(
        default=DEFAULT_AROUND_S, metadata=option("Seconds of a clip after its risky point.", AROUND_S)
    )
    risky_points: int = field(default=3, metadata=option("Maximum number of risky points per run.", RISKY_POINTS))
    children: int = field(default=DEFAULT_CHILDREN, metadata=option("Number of mutants per clip.", CHILDREN_BOUNDS))
    seed: int = 0
    fidelity_limit_m: float = field(default=0.75, metadata={OPTION: None})
    handover_s: float = 0.0
    repeat: int = field(
        default=1, metadata=option("Number of times each clip is mutated, each with another seed.", REPEAT)
    )
    against: tuple[str, ...] = field(
        default=(),
        metadata=option(
            "Reference drivers that also drive every failure, separated by commas, for example idm,pdm+ideal (put a "
            "name that contains a comma in double quotes); `none` for no reference drivers. By default idm, frenetix, "
            "pdm, and the driver itself with ideal sensors.",
            metavar="DRIVERS",
            shows_default=False,
            by_driver=True,
        ),
    )
    allocation: Allocation = field(
        default="even",
        metadata=option(
            "How mutants are distributed: even (each clip gets --children), adaptive (the same total in rounds; "
            "clips whose mutants failed more often get more) or stories (the same total in rounds; mutants go where "
            "they may still add a story).",
            metavar="HOW",
        ),
    )
    rules: RulesMode = RULES_MODE
    goal: str = field(
        default="",
        metadata=option(
            "Search the expectation with this label (`expect NAME: always ...`) instead of collisions: its margin "
            "decides what is studied, and a run that breaks it fails.",
            metavar="NAME",
            shows_default=False,
        ),
    )
    first_from: str = field(
        default="",
        metadata=option(
            "Folder of an earlier campaign, with this or another driver, or of kept failures: mutants that failed "
            "there are run first, in clips of the same test case.",
            metavar="FOLDER",
            shows_default=False,
        ),
    )

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        from foresee_dsl.documents import every_field, where_set  # imports pydantic, which a help text does not need

        return {**every_field(self), "goal": where_set(self.goal), "first_from": where_set(self.first_from)}

    @property
    def in_rounds(self) -> bool:
        """Return whether mutants are allocated in rounds."""
        return self.allocation != "even"

    @property
    def first_children(self) -> int:
        """Return the number of mutants that a clip gets with each seed before any result is known; with the allocation
        `even`, these are all mutants.
        """
        return min(self.children, FIRST) if self.in_rounds else self.children


@dataclass(frozen=True)
class Shard:
    """Part `number` (from 1) of `of` parts of a campaign, by a hash of each test case's key; 0: all parts.

    With allocation in rounds, each part has its own rounds, even if all parts are run together.
    """

    number: int = 0
    of: int = 1

    @classmethod
    def parse(cls, text: str) -> Shard:
        """Read `2/8`, or `all/8`.

        Raises:
            ValueError: it is not two whole numbers, the first of them between 1 and the second.
        """
        first, slash, second = text.partition("/")
        number = "0" if first == "all" else first
        if not (slash and number.isascii() and number.isdigit() and second.isascii() and second.isdigit()):
            raise ValueError(f"{text!r} is not a part of a campaign: write K/N, such as 2/8, or all/8")
        shard = cls(int(number), int(second))
        if not (1 <= shard.number <= shard.of or (first == "all" and shard.of)):
            raise ValueError(f"{text!r} is not a part of a campaign: the parts of {shard.of} are 1 to {shard.of}")
        return shard

    @property
    def text(self) -> str:
        """Return it as one types it, such as `2/8`; "" for the whole campaign."""
        return "" if self == Shard() else f"{self.number or 'all'}/{self.of}"

    @property
    def empty_text(self) -> str:
        """Return, in words, that no test case belongs to the part."""
        return f"no test case belongs to part {self.text}: the key of a test case decides its part"

    def part(self, key: str) -> int:
        """Return the number of the part that contains a test case with this key."""
        return int(key[:12], 16) % self.of + 1

    def holds(self, key: str) -> bool:
        """Return whether a test case with this key is run."""
        return self.number in (0, self.part(key))


@dataclass(frozen=True)
class CampaignLimits:
    """Limits of a run. If a run exceeds one, that is its result (`timeout` or `crash`), and other runs are not
    affected.

    Attributes:
        deadline_s: wall time of a run; None: `drivers.deadlines.STEADY_S` plus `SLOWEST` times the simulated time.
        step_s: wall time of a driver's step; None: `drivers.deadlines.STEP_WALL_S`.
        memory_mb: memory of a worker.
        budget_s: wall time of the campaign after which no step begins; None: no limit.
    """

    deadline_s: float | None = None
    memory_mb: float = 4096
    budget_s: float | None = None
    step_s: float | None = None

    @property
    def deadlines(self) -> Deadlines:
        """Return the deadlines of a driver."""
        return Deadlines(self.step_s, self.deadline_s)

    def for_run(self, simulated_s: float) -> float:
        """Return the wall time limit of a run of this simulated time, s."""
        return self.deadlines.for_run_s(simulated_s)

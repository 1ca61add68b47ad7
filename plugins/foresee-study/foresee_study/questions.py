"""The paper's five questions, as data: the text of each, and the campaigns that answer it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import product
from types import MappingProxyType

from foresee_dsl.campaign.settings import CampaignSettings
from foresee_study.settings import BUNDLED, CHOSEN_S, EVERY_POINT, EXHAUSTIVE, StudyCampaign, StudySettings

CLIPS_S = (6.0, 10.0)
"""Lengths of clips, s: the paper's o_b = o_a of 3 s and of 5 s (section 4.4)."""
POINTS = (1, 2, 4)
"""Numbers of risky points, the paper's n_rp (section 4.4)."""
HEAVY_WEATHER = "heavy_weather"
"""The preset that changes the weather and nothing else (section 4.4, RQ5)."""


@dataclass(frozen=True)
class Question:
    """One of the paper's questions.

    Attributes:
        asks: the question in our words.
        wanted: returns the campaigns that it needs.
    """

    name: str
    title: str
    asks: str
    wanted: Callable[[StudySettings], Iterable[StudyCampaign]]


def campaigns(
    settings: StudySettings,
    rankers: Iterable[str],
    clips_s: Iterable[float] = (CHOSEN_S,),
    *,
    drivers: Iterable[str] | None = None,
    groups: Iterable[str] = (BUNDLED,),
    repetitions: int | None = None,
) -> Iterator[StudyCampaign]:
    """Yield a campaign for each combination and repetition."""
    names = settings.drivers if drivers is None else drivers
    for group, driver, ranker, clip_s in product(groups, names, rankers, clips_s):
        for repetition in range(settings.repetitions if repetitions is None else repetitions):
            seed = settings.seed + repetition
            yield StudyCampaign(group, driver, ranker, clip_s, repetition, seed, settings.preset,
                                children=settings.children, against=settings.against)  # fmt: skip


def exhaustive(settings: StudySettings) -> Iterator[StudyCampaign]:
    """Yield the searches of every second of the test cases.

    The failures of these searches are many and similar, and driving them with reference drivers takes most of the time.
    Therefore only reference drivers that the study names drive them.
    """
    searches = campaigns(settings, (EXHAUSTIVE,), CLIPS_S, drivers=settings.searched,
                         repetitions=settings.exhaustive_repetitions)  # fmt: skip
    return (replace(wanted, risky_points=EVERY_POINT, against=settings.against or ()) for wanted in searches)


def _effectiveness(settings: StudySettings) -> Iterator[StudyCampaign]:
    yield from campaigns(settings, _of(settings, "foresee", "proximity"), CLIPS_S)
    yield from exhaustive(settings)


def _comparison(settings: StudySettings) -> Iterator[StudyCampaign]:
    for preset in (settings.preset, *settings.readings):
        yield from campaigns(replace(settings, preset=preset), settings.rankers)


def _efficiency(settings: StudySettings) -> Iterator[StudyCampaign]:
    yield from campaigns(settings, settings.rankers)
    yield from campaigns(settings, _of(settings, "foresee"), CLIPS_S, drivers=settings.searched)
    yield from exhaustive(settings)


def _complementarity(settings: StudySettings) -> Iterator[StudyCampaign]:
    """Return the campaigns of the first iteration; those of the second depend on its results
    (`study.complementing`)."""
    return campaigns(settings, ("foresee",), repetitions=min(settings.fuzz_repetitions, settings.repetitions))


def _generality(settings: StudySettings) -> Iterator[StudyCampaign]:
    yield from campaigns(settings, ("foresee",), groups=(BUNDLED, *settings.towns))
    for wanted in campaigns(settings, ("foresee",)):
        yield replace(wanted, preset=HEAVY_WEATHER, children=1)


def _searches(settings: StudySettings) -> Iterator[StudyCampaign]:
    """Yield the campaigns of the rankers, `reach` among them, and of the searches; those of one repetition together, so
    that a study that is stopped can compare all of them."""
    rankers = tuple(dict.fromkeys((*settings.rankers, "reach")))
    every = [replace(wanted, allocation=settings.allocation) for wanted in campaigns(settings, rankers)]
    every += [
        replace(wanted, budget_s=settings.budget_s, risky_points=EVERY_POINT, children=0)
        for wanted in campaigns(settings, settings.searches)
    ]
    yield from sorted(every, key=lambda wanted: wanted.repetition)


def _default(settings: StudySettings) -> Iterator[StudyCampaign]:
    """Yield the campaigns with the ranker and the preset of `foresee campaign`, with the study's number of risky
    points; they contain the clips of fewer points."""
    for wanted in campaigns(settings, (CampaignSettings.ranker,)):
        yield replace(wanted, preset=CampaignSettings.preset)


def _of(settings: StudySettings, *names: str) -> tuple[str, ...]:
    return tuple(name for name in names if name in settings.rankers)


QUESTIONS: Mapping[str, Question] = MappingProxyType(
    {
        q.name: q
        for q in (
            Question("rq1", "Effectiveness",
                     "How many failures come from near misses, by length of the clips and number of risky points, and "
                     "what share of an exhaustive search is that?", _effectiveness),
            Question("rq2", "Comparison",
                     "Does forecasting find more failures than random points, SelfOracle's alarms, or mere proximity?",
                     _comparison),
            Question("rq3", "Efficiency", "How fast are failures found?", _efficiency),
            Question("rq4", "Complementarity", "What does forecasting find where DriveFuzz found nothing?",
                     _complementarity),
            Question("rq5", "Generality", "Does it work in other towns, with other drivers, in heavy weather?",
                     _generality),
            Question("search", "Searches from the literature",
                     "What do the rankers and the searches of other papers find in the same simulated time?",
                     _searches),
            Question("default", "The default search",
                     "What does the search of `foresee campaign` find, and the others in the simulated time that it "
                     "takes?", _default),
        )
    }
)  # fmt: skip
"""The paper's questions (section 4.1), by name, and ours: `search` and `default`."""
PAPERS = tuple(name for name in QUESTIONS if name.startswith("rq"))
"""The paper's questions."""


def wanted_by(names: Iterable[str], settings: StudySettings) -> tuple[StudyCampaign, ...]:
    """Return the campaigns that questions need, each once, in the order of the questions."""
    return tuple(dict.fromkeys(wanted for name in names for wanted in QUESTIONS[name].wanted(settings)))

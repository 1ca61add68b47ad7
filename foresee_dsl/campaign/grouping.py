"""Groups a campaign's failures into findings: failures with the same story, represented by the simplest."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import PurePosixPath

from foresee_dsl.avoidance.responsibility import Responsibility, responsibility_of
from foresee_dsl.campaign.driving import case_file_name
from foresee_dsl.campaign.records import CaseRunOutcome, ChildOutcome, ClipOutcome, Minimised, Repeats, WrittenFinding
from foresee_dsl.language.document import family_order
from foresee_dsl.language.model import Mutant, Quantity
from foresee_dsl.language.parser import parse
from foresee_dsl.simulate.results.verdict import Verdict
from foresee_dsl.story import Story

Failure = CaseRunOutcome | ChildOutcome
"""A failing test case or mutant."""


@dataclass(frozen=True)
class Finding:
    """Failures with the same story.

    All statements about a finding are about one run, `run`: that of the minimised representative, if it fails too.

    Attributes:
        name: name of the representative, the simplest of the failures. story_as_found: its story before minimisation.
          siblings, sibling_files: names and files of the other failures, sorted.
        test_case: address of the representative's test case. family: the family of all failures. file: the file of the
            representative, relative to the campaign's folder; for a test case its address.
        clip: file of the representative's clip, relative to the campaign's folder; "" for a test case.
        minimised: the minimised representative, if any.
        avoided: number of failures that some reference driver avoids and whose unmutated clip the same driver passes;
          None if there are no reference drivers.
        title: its story in at most twelve words. The first six words differ from those of all other findings.
        number: its place in the campaign's order, from 1, by which commands address it; 0 before it is sorted.
    """

    name: str
    story_as_found: Story
    representative: Failure
    test_case: str
    family: str
    file: str
    clip: str = ""
    siblings: tuple[str, ...] = ()
    sibling_files: tuple[str, ...] = ()
    minimised: Minimised | None = None
    avoided: int | None = None
    title: str = ""
    number: int = 0
    repeats: Repeats | None = None
    """Its runs in other processes; None before them, or if they say nothing."""

    def as_document(self) -> dict[str, object]:
        """Return its JSON document."""
        document = WrittenFinding.as_document(self.written)
        # The JSON schema is derived from these expressions (`documents.shape`); these three name their whole types.
        return {**document, "judgement": self.responsibility, "class": self.story.contact, "minimised": self.minimised}

    @property
    def written(self) -> WrittenFinding:
        """Return what `campaign.json` states about it."""
        run, story = self.run, self.story
        return WrittenFinding(
            number=self.number,
            name=self.name,
            title=self.title,
            story=self.story_key,
            judgement=self.responsibility,
            sentence=story.sentence,
            class_=story.contact,
            verdict=self.verdict,
            test_case=self.test_case,
            family=self.family,
            file=self.file,
            clip=self.clip or None,
            count=self.count,
            siblings=self.siblings,
            sibling_files=self.sibling_files,
            preventability=run.preventable,
            why=run.preventability.why if run.preventability else None,
            anticipation=run.anticipation.answer if run.anticipation else None,
            anticipation_why=run.anticipation.why if run.anticipation else None,
            opinions=run.opinions,
            avoided=self.avoided,
            references=run.references,
            ego_manoeuvre=story.ego_manoeuvre,
            opponent_manoeuvre=story.opponent_manoeuvre or None,
            place=story.place,
            mutation=story.mutation or None,
            minimised=self.minimised.written if self.minimised else None,
            repeats=self.repeats,
            rate=self.rate or None,
        )

    @property
    def story_key(self) -> str:
        """The words by which its failures are grouped; a later campaign's finding with the same words is the same
        story."""
        return " | ".join(story_cell(self.family, self.story_as_found))

    @property
    def rate(self) -> str:
        """How many runs fail if the driver is not deterministic: `7/10`; "" otherwise."""
        repeats = self.repeats
        return f"{repeats.failed}/{repeats.runs}" if repeats is not None and not repeats.same else ""

    @property
    def reduced(self) -> Minimised | None:
        """Return the minimised representative, if it fails; None if there is none, or if minimising it failed."""
        small = self.minimised
        return small if small is not None and small.child.story is not None else None

    @property
    def run(self) -> Failure:
        """Return the run that all statements about the finding describe."""
        return self.reduced.child if self.reduced is not None else self.representative

    @property
    def story(self) -> Story:
        """Return what happens in `run`."""
        return self.run.story or self.story_as_found

    @property
    def verdict(self) -> Verdict:
        """Return how `run` ended."""
        return self.run.verdict

    @property
    def responsibility(self) -> Responsibility:
        """Return whose failure `run` is, and the reason in one line."""
        return responsibility_of(self.story, self.verdict, self.run.judgements, self.run.references)

    @property
    def order(self) -> tuple[bool, int, bool, float, tuple[int, bool, float], str]:
        """Return the sort key of reports.

        It begins with whether the failure breaks the campaign's goal, if there is one, and whose failure it is; then
        people on foot or on two wheels come first; then the hardest contact; then the smallest change, with steering
        and other models last; then the name.
        """
        unprotected = self.story.opponent_kind in ("pedestrian", "bicycle", "motorcycle")
        speed_mps = self.run.impact.relative_mps if self.run.impact is not None else 0.0
        whose, change = self.responsibility.whose.rank, _simplicity(self.run)
        return not self.run.breaks_goal, whose, not unprotected, -round(speed_mps, 1), change, self.name

    @property
    def avoidable(self) -> bool:
        """Return whether a judge, or a reference driver for any of the failures, says that it could have been
        avoided.
        """
        return any(judgement.avoids for judgement in self.run.judgements) or bool(self.avoided)

    @property
    def count(self) -> int:
        """Return the number of failures."""
        return 1 + len(self.siblings)


def story_cell(family: str, story: Story) -> tuple[str, ...]:
    """Return the words by which failures are grouped: failures of one family with equal stories are one finding."""
    return family, *story.signature


def findings_of(seeds: Iterable[CaseRunOutcome], clips: Iterable[ClipOutcome]) -> tuple[Finding, ...]:
    """Return the findings of a campaign's test cases and clips, sorted by family, then by descending number of
    failures, then by name.
    """
    groups: dict[tuple[str, ...], list[Finding]] = defaultdict(list)
    for failure in _failures(seeds, clips):
        groups[story_cell(failure.family, failure.story_as_found)].append(failure)
    findings = (_joined(sorted(g, key=lambda f: (_simplicity(f.representative), f.name))) for g in groups.values())
    return tuple(sorted(findings, key=lambda f: (family_order(f.family), -f.count, f.name)))


def in_order(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return findings in the order of reports (`Finding.order`), numbered from 1 and with their titles."""
    ordered = sorted(findings, key=lambda finding: finding.order)
    titles = _titles(ordered)
    return tuple(replace(finding, number=k + 1, title=titles[k]) for k, finding in enumerate(ordered))


TELLING_WORDS = 6
"""Maximum number of words of a title's beginning, by which a reader tells titles apart."""


def _titles(findings: Sequence[Finding]) -> list[str]:
    """Return a title for each finding; titles that begin alike get the test case or the mutant in front."""
    stories = [finding.story.title for finding in findings]
    ways = (
        stories,
        [f"{_case_name(f)}: {s}" for f, s in zip(findings, stories, strict=True)],
        [f"{f.name}: {s}" for f, s in zip(findings, stories, strict=True)],
    )
    titles = [""] * len(findings)
    left = list(range(len(findings)))
    for way in ways:
        words = [_beginning(titles[k] if k not in left else way[k]) for k in range(len(findings))]
        titles = [way[k] if k in left else titles[k] for k in range(len(findings))]
        left = [k for k in left if words.count(words[k]) > 1]
    return titles


def _beginning(title: str) -> tuple[str, ...]:
    return tuple(title.lower().split()[:TELLING_WORDS])


def _case_name(finding: Finding) -> str:
    """Return the name of a finding's test case, or of its file, as it is written."""
    path, _, case = finding.test_case.partition("::")
    return case or PurePosixPath(path).stem


def _joined(group: list[Finding]) -> Finding:
    """Return the finding of failures with the same story, the simplest first."""
    first, *others = group
    others.sort(key=lambda failure: failure.name)
    driven = [failure.representative for failure in group if failure.representative.references]
    return replace(
        first,
        siblings=tuple(failure.name for failure in others),
        sibling_files=tuple(failure.file for failure in others),
        avoided=sum(bool(run.avoided) for run in driven) if driven else None,
    )


def _failures(seeds: Iterable[CaseRunOutcome], clips: Iterable[ClipOutcome]) -> Iterator[Finding]:
    """Yield each failure with a story as a finding of its own."""
    for case in seeds:
        if case.story is not None:
            yield Finding(case_file_name(case.id, case.scenario), case.story, case, case.id, case.family, case.id)
    for clip in clips:
        for child in clip.failing:
            if child.story is not None:
                yield Finding(child.name, child.story, child, clip.seed, clip.family, child.file, clip.file)


def _simplicity(run: Failure) -> tuple[int, bool, float]:
    """Return a sort key for simplicity.

    The key consists of the number of changed lines, whether one of them steers or swaps a model, and the sizes of the
    changes. A test case has none.
    """
    if isinstance(run, CaseRunOutcome):
        return 0, False, 0.0
    model = parse(run.text, run.name).model
    changes = model.changes if isinstance(model, Mutant) else ()
    far = sum(abs(c.now.si - c.was.si) for c in changes if isinstance(c.now, Quantity) and isinstance(c.was, Quantity))
    implausible = any(c.property in ("steer", "model") for c in changes)
    return len(changes), implausible, round(far, 9)

"""What an allocation in rounds is: a class that chooses the mutants of a round from all results so far."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple, Protocol

if TYPE_CHECKING:
    from numpy.random import Generator

    from foresee_dsl.campaign.allocation.draws import ClipDraws, Option, PastChild


class RoundBudget(NamedTuple):
    """The frame of a round.

    Attributes:
        number, of: index of the round, from 1, and number of rounds. children: number of its mutants. most: largest
            number of mutants of one clip in it and with one seed. rng: random choices of this round.
    """

    number: int
    of: int
    children: int
    most: int
    rng: Generator


class Method(Protocol):
    """An allocation in rounds; its choices may depend on nothing but its arguments.

    Attributes: rounds: number of rounds, the first included, in which each clip gets one mutant. words: who gets the
    others.
    """

    @property
    def rounds(self) -> int:
        """Return the number of rounds."""
        ...

    @property
    def words(self) -> str:
        """Return, in words, what gets the mutants of the later rounds."""
        ...

    def give_out(self, clips: Sequence[ClipDraws], past: Sequence[PastChild], budget: RoundBudget) -> None:
        """Request the mutants of a round from the clips, fewer than `budget.children` if there are no more.

        `clips`: in an order that depends only on content hashes. `past`: all mutants so far, in the order of their
        rounds.
        """
        ...


def why_near(clip: ClipDraws, option: Option) -> str:
    """Return, in words, what the mutant did whose changes a further one uses."""
    base = option.base
    if base is None:
        return ""
    facts = clip.facts(option)
    return f"{base.step.name} {'failed' if facts.story else f'passed, {facts.miss}'}"

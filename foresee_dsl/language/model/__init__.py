"""The typed model of everything that a `.foresee` file can state.

Each statement has a class. Blocks keep their statements in `body`, in the author's order, so that printing a model
gives the file back. A class contains the pattern of its text (`item.Item`); `ITEMS` lists all classes.
"""
# ruff: noqa: F403, F405 - every class of these modules is part of the model, so that a new one need not be listed here

from foresee_dsl.language.model.actions import *
from foresee_dsl.language.model.actors import *

# isort: split - triggers come right after actors: where two classes have a word, the first or the last of them counts
from foresee_dsl.language.model.triggers import *

# isort: split
from foresee_dsl.language.model.campaign import *
from foresee_dsl.language.model.conditions import *
from foresee_dsl.language.model.derived import *
from foresee_dsl.language.model.item import *
from foresee_dsl.language.model.network import *
from foresee_dsl.language.model.scenario import *
from foresee_dsl.language.model.streets import *
from foresee_dsl.language.model.values import *

Definition = Scenario | Extension | Clip | Mutant | Network | Catalogue | Campaign
"""The definition in a file: one of these."""

ITEMS: tuple[type[Item], ...] = tuple(
    kind
    for kind in vars().copy().values()
    if isinstance(kind, type) and issubclass(kind, Item) and kind not in (Item, Phrase, Block)
)
"""Every class of the model."""

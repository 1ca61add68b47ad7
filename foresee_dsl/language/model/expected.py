"""The expected result of a run with a driver: recorded with a test case, but not part of its meaning."""

from typing import Annotated, Literal

from foresee_dsl.language.model.item import Item, Names
from foresee_dsl.language.model.values import ActorName, Id, Name

FailureName = Literal["F1", "F2", "F3", "F4", "F5", "stuck", "rule", "timeout"]
"""Names of failures, as in `simulate.results.verdict`. A crash cannot be expected."""


class Expected(Item):
    """`expected pdm fails F2 with walker`, `expected "pdm 2" passes`, `expected idm in case r02 fails`.

    The driver has its name on the command line, or its own name with a version if only that version is meant.
    """

    pattern = "expected {driver} [in case {case}] {outcome} [{failure}] [with {actor}]"
    words = """
        expected (statement): how the run ends with a driver, as recorded; means nothing to the run
            | expected pdm fails F2 with walker
        fails (link): the run ends in a failure: in this kind, with this actor | expected pdm fails F2 with walker
        F1 (constant): a failure: off the road, or into an object | expected pdm fails F1
        F2 (constant): a failure: a collision with a pedestrian | expected pdm fails F2 with walker
        F3 (constant): a failure: a frontal collision | expected pdm fails F3 with oncoming
        F4 (constant): a failure: a lateral collision | expected pdm fails F4 with runner
        F5 (constant): a failure: a rear collision | expected pdm fails F5 with lead
        stuck (constant): a failure: it stands with nothing to wait for | expected pdm fails stuck
        rule (constant): a failure: it breaks a traffic rule | expected pdm fails rule
        timeout (constant): a failure: it does not arrive in time | expected pdm fails timeout
    """

    driver: Id
    case: Annotated[Name, Names("case")] | None = None
    """The case of a scenario with cases; None: every case."""
    outcome: Literal["passes", "fails"]
    failure: FailureName | None = None
    """The kind of failure; None: any."""
    actor: ActorName | None = None

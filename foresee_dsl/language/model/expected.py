"""The expected result of a run with a driver: recorded with a test case, but not part of its meaning."""

from typing import Annotated, Literal

from foresee_dsl.language.model.item import Item, Names
from foresee_dsl.language.model.values import ActorName, Id, Name

FailureName = Literal["F1", "F2", "F3", "F4", "F5", "stuck", "rule", "timeout"]
"""Names of failures, the same as in `simulate.results.verdict`. A crash cannot be expected."""


class Expected(Item):
    """`expected pdm fails F2 with walker`, `expected "pdm 2" passes`, `expected idm in case r02 fails`: the recorded
    result of a run with a driver.

    The driver is named as on the command line, or by its own name with a version if only that version is meant.
    """

    pattern = "expected {driver} [in case {case}] {outcome} [{failure}] [with {actor}]"
    words = """
        expected (statement): the recorded result of a run with a driver; it has no effect on the run
            | expected pdm fails F2 with walker
        fails (link): the run ends in a failure, of this kind and with this actor if they are named
            | expected pdm fails F2 with walker
        F1 (constant): the failure of an ego that leaves the road or hits an object | expected pdm fails F1
        F2 (constant): the failure of an ego that collides with a pedestrian | expected pdm fails F2 with walker
        F3 (constant): the failure of an ego in a frontal collision | expected pdm fails F3 with oncoming
        F4 (constant): the failure of an ego in a lateral collision | expected pdm fails F4 with runner
        F5 (constant): the failure of an ego in a rear collision | expected pdm fails F5 with lead
        stuck (constant): the failure of an ego that stands although nothing makes it wait | expected pdm fails stuck
        rule (constant): the failure of an ego that breaks a traffic rule | expected pdm fails rule
        timeout (constant): the failure of an ego that does not arrive in time | expected pdm fails timeout
    """

    driver: Id
    case: Annotated[Name, Names("case")] | None = None
    """The case of the scenario for which the result was recorded; None: for every case."""
    outcome: Literal["passes", "fails"]
    failure: FailureName | None = None
    """The kind of failure; None: any kind."""
    actor: ActorName | None = None

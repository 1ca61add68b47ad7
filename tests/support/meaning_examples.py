"""Small models, built in Python, that the tests of the meaning side share."""

from __future__ import annotations

from pathlib import Path

from foresee_dsl.language.document import TestCase
from foresee_dsl.language.meaning import meaning_hash
from foresee_dsl.language.model import (
    Actor,
    Assignment,
    Case,
    Change,
    Clip,
    Comparison,
    CruiseSpeed,
    Doc,
    EdgeRoute,
    Ego,
    End,
    Expect,
    Fidelity,
    Goal,
    Junction,
    Leg,
    Measure,
    Meets,
    Mutant,
    Network,
    Param,
    Predicate,
    Ref,
    Risk,
    Road,
    Route,
    Scenario,
    SignalState,
    State,
    Tags,
    Traffic,
    Weather,
    When,
    Window,
)
from tests.support.worlds import case_from, model, point, q

NAMES = ("car.compact", "car.sedan", "car.sports", "van.delivery", "pedestrian.adult", "bicycle.city")
MODELS = {name: model(name, source="ours") for name in NAMES}

NETWORK = Network(
    name="crossing",
    body=(
        Doc(text="Two roads."),
        Junction(name="j4", at=point("0", "0"), control="priority"),
        Junction(name="far", at=point("100", "0")),
        Road(name="main", start="far", end="j4", speed=q("50 km/h")),
    ),
)

SCENARIO = Scenario(
    name="runner",
    body=(
        Doc(text="A vehicle runs a red light."),
        Tags(names=("scenario7", "junction")),
        Param(name="approach", type="arm", default="south"),
        Param(name="way", type="turn", default="straight"),
        Param(name="gap", type="time", default=q("1.5 s")),
        Param(name="pace", type="speed", default=q("50 km/h")),
        Param(name="what", type="model", default="car.compact"),
        Weather(rain=q("0.3"), wetness=q("0.4")),
        Ego(
            model="car.sedan",
            body=(Route(start=Ref(name="approach"), legs=(Leg(turn=Ref(name="way"), junction="j4"),)),),
        ),
        Actor(
            kind="vehicle",
            name="runner",
            model=Ref(name="what"),
            body=(EdgeRoute(edges=("west", "east_back")), CruiseSpeed(speed=Ref(name="pace"))),
        ),
        Actor(kind="pedestrian", name="walker", model="pedestrian.adult", body=(CruiseSpeed(speed=q("1.4 m/s")),)),
        Traffic(name="others", count=q("4"), models=("car.sedan", "van.delivery"), within=q("120 m"), seed=q("7")),
        SignalState(junction="j4", stage="ns_go", elapsed=q("2 s")),
        When(
            condition=Comparison(left=Measure(what="eta", actor="ego", other="j4"), op="<", right=q("4 s")),
            actions=(Meets(actor="runner", other="ego", junction="j4", gap=Ref(name="gap")),),
        ),
        Expect(mode="never", condition=Predicate(what="collision", actor="ego")),
        Expect(
            mode="always",
            condition=Comparison(left=Measure(what="ttc", actor="ego", other="walker"), op=">", right=q("1 s")),
        ),
        Expect(mode="eventually", within=q("60 s"), condition=Predicate(what="arrived", actor="ego")),
        End(after=q("60 s")),
        Case(name="r01", values=(Assignment(name="gap", value=q("1.2 s")),)),
        Case(
            name="r02",
            values=(
                Assignment(name="approach", value="east"),
                Assignment(name="way", value="left"),
                Assignment(name="pace", value=q("62 km/h")),
                Assignment(name="what", value="car.sports"),
            ),
        ),
    ),
)


def example_case(scenario: Scenario, network: Network | Path = NETWORK, folder: Path = Path("/project")) -> TestCase:
    """The test case of a scenario with the models of the examples."""
    return case_from(scenario, network, MODELS, folder=folder, meaning=meaning_hash(scenario, network, MODELS))


def state(x: str, speed: str) -> State:
    return State(at=point(x, "1.5"), heading=q("90 deg"), speed=q(speed))


def clip_of(pin: str, **replaced: object) -> Clip:
    """A clip of `SCENARIO` in which the walker is not; `replaced` gives other fields."""
    fields: dict[str, object] = {
        "name": "runner_p1",
        "parent": "runner.foresee",
        "case": "r02",
        "pin": pin,
        "body": (
            Window(start=q("12.40 s"), end=q("22.40 s")),
            Risk(text="it was close", at=q("17.40 s"), actor="runner"),
            Ego(model="car.sedan", state=state("0", "10 m/s"), body=(EdgeRoute(edges=("south", "north_back")),)),
            Goal(at=point("40", "0")),
            Actor(kind="vehicle", name="runner", model="car.compact", state=state("5", "17.220 m/s")),
            Actor(kind="vehicle", name="others_03", model="van.delivery", state=state("9", "8 m/s")),
            SignalState(junction="j4", stage="ns_go", elapsed=q("11.35 s")),
            Fidelity(deviation=q("0.00 m")),
        ),
    }
    return Clip.model_validate(fields | replaced)


def change(target: str, was: str, now: str, **times: str) -> Change:
    """`change("runner.steer", "0.00", "0.12", start="4 s")`."""
    actor, _, name = target.partition(".")
    was_value, now_value = ((text if name == "model" else q(text)) for text in (was, now))
    extra = {key: q(value) for key, value in times.items()}
    return Change.model_validate({"actor": actor, "property": name, "was": was_value, "now": now_value} | extra)


def mutant_of(*changes: Change, pin: str = "sha256:000000000000") -> Mutant:
    return Mutant(name="runner_p1_m1", parent="runner_p1.foresee", pin=pin, body=changes)

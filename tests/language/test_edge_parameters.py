"""Edges of a `route [...]` may be parameters."""

from __future__ import annotations

from foresee_dsl.language import model as m
from foresee_dsl.language.checks.documents import check_document
from foresee_dsl.language.parser import parse
from foresee_dsl.language.project.concretise import concretise

TEXT = """foresee 1

scenario way {{
  use network "town.net.xml"

  param first: {type} = {value}
  param last: arm = "12"

  ego: car.sedan {{
    route [first, ..., "last", last]
  }}

  case r1 {{ last = "-3" }}
}}
"""


def test_the_edges_are_those_of_the_case() -> None:
    document = parse(TEXT.format(type="arm", value='"-11"'), "x.foresee")
    assert isinstance(document.model, m.Scenario)
    route = document.model.actors[0].body[0]
    assert isinstance(route, m.EdgeRoute)
    assert route.edges == (m.Ref(name="first"), "last", m.Ref(name="last"))
    ego = concretise(document.model, "r1", document=document).actors[0]
    assert ego.body == (m.EdgeRoute(edges=("-11", "last", "-3"), shortest=True),)


def test_a_parameter_of_another_type_is_a_mistake_at_its_place() -> None:
    found = check_document(parse(TEXT.format(type="time", value="3 s"), "x.foresee"))[0]
    assert (found.code, found.help) == ("FS032", "use a parameter of type `arm`: last")
    assert found.span is not None
    assert (found.span.line, found.span.column) == (10, 12)


def test_a_number_is_no_edge() -> None:
    text = TEXT.format(type="arm", value='"a"').replace('last = "-3"', "last = 3 m")
    assert [found.code for found in check_document(parse(text, "x.foresee"))] == ["FS034"]

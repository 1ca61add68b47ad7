"""Hypothesis strategies for every class of the model, made from its fields and their annotations.

A statement that is added to the model is generated without a change here. Only what an annotation cannot say (which
fields exclude each other, that a word which refers to a parameter needs one of that name) is written out below.
"""

from __future__ import annotations

import functools
import re
import string
import types
from collections.abc import Callable, Iterator
from decimal import Decimal
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from hypothesis import assume
from hypothesis import strategies as st
from lark.exceptions import UnexpectedInput
from lark.lexer import PatternStr
from pydantic import TypeAdapter, ValidationError
from pydantic.fields import FieldInfo

from foresee_dsl import disk_cache
from foresee_dsl.language import model as m
from foresee_dsl.language.model.values import NAME_PATTERN
from foresee_dsl.language.syntax.grammar import grammar_text, parse_tree, parser
from foresee_dsl.language.syntax.nodes import RESERVED
from foresee_dsl.language.traversal import walk
from foresee_dsl.language.units import SI_WORD, UNITS, Dimension

Strategy = st.SearchStrategy[Any]
_T = TypeVar("_T", bound=m.Item)

DEEPEST = 3
"""Largest nesting of classes that can contain themselves (conditions, `then`)."""
KEYWORDS = sorted(
    t.pattern.value for t in parser().terminals if isinstance(t.pattern, PatternStr) and t.pattern.value.isidentifier()
)


@functools.cache
def hints(kind: type[m.Item]) -> dict[str, Any]:
    """Return the annotations of a class's fields."""
    found = get_type_hints(kind, include_extras=True)
    return {name: hint for name, hint in found.items() if name in kind.model_fields}


def alternatives(hint: Any) -> Iterator[Any]:
    """Return what an annotation may be: the members of its unions, without `Annotated` around these."""
    origin = get_origin(hint)
    if origin in (Union, types.UnionType):
        for part in get_args(hint):
            yield from alternatives(part)
    elif origin is Annotated and (get_origin(inner := get_args(hint)[0]) in (Union, types.UnionType) or inner is m.Ref):
        yield from alternatives(inner)
    else:
        yield hint


def parts(hint: Any) -> Iterator[type[m.Item]]:
    """Return the classes of the model that an annotation names, in tuples too."""
    for one in alternatives(hint):
        if isinstance(one, type) and issubclass(one, m.Item):
            yield one
        elif get_origin(one) is tuple or get_origin(one) is Annotated:
            yield from parts(get_args(one)[0])


@functools.cache
def classes() -> tuple[type[m.Item], ...]:
    """Return every class of the model that a file may hold, in the order in which they are met."""
    found: dict[type[m.Item], None] = {}
    waiting = list(get_args(m.Definition))
    while waiting:
        kind = waiting.pop(0)
        if kind not in found:
            found[kind] = None
            waiting += [part for hint in hints(kind).values() for part in parts(hint)]
    return tuple(found)


@functools.cache
def _inside(kind: type[m.Item]) -> frozenset[type[m.Item]]:
    """Return the classes that can be somewhere in a class."""
    found: set[type[m.Item]] = set()
    waiting = [kind]
    while waiting:
        new = {part for hint in hints(waiting.pop()).values() for part in parts(hint)} - found
        found |= new
        waiting += new
    return frozenset(found)


@functools.cache
def _not_free() -> frozenset[str]:
    """Return the words that the language takes for its own where a parameter's name may stand too."""
    literals = {
        word
        for kind in classes()
        for hint in hints(kind).values()
        if m.Ref in (found := list(alternatives(hint)))
        for one in found
        if get_origin(one) is Literal
        for word in get_args(one)
    }
    return frozenset(literals) | _reserved() | RESERVED


@functools.cache
def _reserved() -> frozenset[str]:
    """Return the words that begin something else where an actor's name or a label would begin a statement."""
    actions = (
        "starts",
        "stops",
        "ignores priority",
        "changes lane left",
        "changes speed to 3 m/s",
        "meets a at b after c",
        "turns to a",
        "keeps 1 m left of a",
        "follows a gap 1 s",
        "leaves",
    )
    conditions = (
        *(
            "in junction a",
            "within 3 m of a",
            "is a",
            "< 3 m",
            "ahead of a",
            "behind a",
            "in lane of a",
            "in lane 2 of a",
        ),
        *("sees a", "in sight of a"),
    )
    forms = ["when {0}: time > 1 s {{ a starts }}", "expect {0}: never collision(a)"]
    forms += [f"when time > 1 s {{{{ {{0}} {action} }}}}" for action in actions]
    # a parameter's name where a value begins a place, or is the number of a lane
    forms += [
        f"expect never a {rest}"
        for rest in ("within 3 m of {0} ahead of b", "within 3 m of {0} along b", "in lane {0} of b")
    ]
    forms += [
        f"{start} {{0}} {condition}" for condition in conditions for start in ("expect never", "expect never within a")
    ]
    forms += [f"when {{0}} {condition} {{{{ a starts }}}}" for condition in conditions]
    forms += ["when time > 1 s {{ b keeps 1 m {0} of a }}", "expect never a within 3 m of beside b {0} 1 m"]
    file = disk_cache.entry("reserved", (grammar_text(), *forms))  # 8 s of CPU time for each worker
    words: frozenset[str] | None = disk_cache.load(file)
    if words is None:
        words = frozenset(word for word in KEYWORDS if not all(_parses(form.format(word)) for form in forms))
        disk_cache.store(file, words)
    return words


def _parses(statement: str) -> bool:
    try:
        parse_tree(statement, "scenario_item")
    except UnexpectedInput:
        return False
    return True


# ---- values ---------------------------------------------------------------------------------------------------------

# Few different names, most of them keywords: so that they clash with the grammar and with each other.
_FIRST, _FURTHER = string.ascii_lowercase, string.ascii_lowercase + string.digits + "_"
assert all(re.fullmatch(NAME_PATTERN, first + _FURTHER) for first in _FIRST)
# Where a place begins a line of a list, these two are its first word, so that no name stands there.
_PLACES = {"the", "beside"}
names = st.sampled_from([*sorted({*KEYWORDS} - _PLACES), "a", "b_2", "runner", "j4", "m", "s", "time"]) | st.builds(
    "{}{}".format, st.sampled_from(_FIRST), st.text(st.sampled_from(_FURTHER), max_size=12)
)  # `from_regex` takes five times as long
free_names = names.filter(lambda name: name not in _not_free())
model_names = st.builds("{}.{}".format, names, names).filter(lambda name: len(name) <= 80)
# Said by categories, not by `codec="utf-8"`, whose characters Hypothesis tries one by one: 5 s in a new checkout.
_WRITABLE = st.characters(exclude_categories=["Cs"])
texts = st.text(st.characters(exclude_characters='"\n\r', exclude_categories=["Cs"]), max_size=12)
ids = names | st.text(st.characters(exclude_characters='"\n\r\\', exclude_categories=["Cs"]), min_size=1, max_size=8)
files = texts.filter(bool)
numbers = st.decimals(-1000, 1000, places=2) | st.integers(-9, 999).map(Decimal) | st.just(Decimal("12.340"))
REFERENCES = st.builds(m.Ref, name=free_names)


def quantities(dimension: Dimension | None = None) -> st.SearchStrategy[m.Quantity]:
    """Return quantities of a dimension, or of any."""
    if dimension == "count":
        return st.integers(0, 99).map(lambda n: m.Quantity(value=Decimal(n)))
    units = [w for w, unit in UNITS.items() if dimension is None or unit.dimension == dimension]
    if dimension in (None, "ratio"):
        units.append("")
    return st.builds(m.Quantity, value=numbers, unit=st.sampled_from(units))


def _validated_quantities(hint: Any) -> Strategy:
    """Quantities that an annotation's validators accept, found by asking them (`Time`, `Count`, ...)."""
    adapter: TypeAdapter[Any] = TypeAdapter(hint)

    def accepts(value: str, unit: str) -> bool:
        try:
            adapter.validate_python(m.Quantity(value=Decimal(value), unit=unit))
        except ValidationError:
            return False
        return True

    units = [unit for unit in ("", *UNITS) if accepts("1", unit)]
    own = numbers if accepts("-1.5", units[0]) else st.integers(0, 99).map(Decimal)
    found: Strategy = st.builds(m.Quantity, value=own, unit=st.sampled_from(units))
    return found | REFERENCES if m.Ref in list(alternatives(get_args(hint)[0])) else found


def _strings(limits: list[Any]) -> Strategy:
    """Strings of a pattern and length, as pydantic's metadata say it."""
    pattern = next((limit.pattern for limit in limits if getattr(limit, "pattern", None)), None)
    low = max((limit.min_length for limit in limits if hasattr(limit, "min_length")), default=0)
    high = min((limit.max_length for limit in limits if hasattr(limit, "max_length")), default=10_000)
    if pattern is None:
        return texts.filter(lambda text: low <= len(text))
    if pattern == rf"^{NAME_PATTERN}$":
        return names
    if pattern == rf"^{NAME_PATTERN}\.{NAME_PATTERN}$":
        return model_names
    bare = pattern.removeprefix("^").removesuffix("$")
    word = re.compile(bare)
    sometimes = (names | texts).filter(lambda text: word.fullmatch(text) and low <= len(text))
    free = st.from_regex(bare, fullmatch=True, alphabet=_WRITABLE).filter(lambda text: low <= len(text) <= high)
    return free | sometimes if word.fullmatch("a") else free


def _limits(metadata: Any) -> list[Any]:
    """Return the single limits of an annotation's metadata (pydantic keeps several in one `Field`)."""
    return [part for info in metadata for part in (info.metadata if isinstance(info, FieldInfo) else [info])]


# ---- what an annotation cannot say ----------------------------------------------------------------------------------


def _measures(depth: int) -> Strategy:
    fields = hints(m.Measure)
    needs = {"time": (), "speed": ("actor",), "acceleration": ("actor",)}

    def measure(what: str) -> Strategy:
        given = {name: of(fields[name], depth=depth).filter(bool) for name in needs.get(what, ("actor", "other"))}
        return st.builds(m.Measure, what=st.just(what), **given)

    return st.one_of([measure(what) for what in get_args(fields["what"])])


def _params(depth: int) -> Strategy:
    def sound(made: m.Param) -> m.Param:
        options = None if made.range else made.options
        if made.type not in SI_WORD:
            return made.model_copy(update={"options": options})
        # A word is no value of a quantity: where one stands, a parameter is meant, and the parser looks for it.
        numbers = tuple(one for one in options or () if not isinstance(one, str)) or None
        default = m.Quantity(value=Decimal(1), unit="") if isinstance(made.default, str) else made.default
        return made.model_copy(update={"options": numbers, "default": default})

    return _builds(m.Param, depth).map(sound)


def _some(kind: type[m.Item]) -> Callable[[int], Strategy]:
    """Items of a class all of whose fields are optional: with one of them at least."""
    fields = [name for name in kind.model_fields if name != "kind"]
    return lambda depth: _builds(kind, depth).filter(lambda item: any(getattr(item, n) is not None for n in fields))


def _changes(depth: int) -> Strategy:
    owners = st.sampled_from(sorted(["ego", *m.OWNERS])) | names
    return owners.flatmap(
        lambda owner: _builds(
            m.Change,
            depth,
            actor=st.just(owner),
            property=names if not (known := m.changeable_of(owner)) else st.sampled_from(known),
        )
    )


def _expected(depth: int) -> Strategy:
    """Only what fails has a kind of failure, and only with that an actor."""

    def sound(item: m.Expected) -> m.Expected:
        failure = item.failure if item.outcome == "fails" else None
        return item.model_copy(update={"failure": failure, "actor": item.actor if failure else None})

    return _builds(m.Expected, depth).map(sound)


def _negatives(depth: int) -> Strategy:
    """A number has its sign itself: `-2 m` is no calculation."""
    return _builds(m.Negative, depth).filter(lambda item: not isinstance(item.value, m.Quantity))


SPECIAL: dict[type[m.Item], Callable[[int], Strategy]] = {
    m.Measure: _measures,
    m.Param: _params,
    m.Change: _changes,
    m.Expected: _expected,
    m.Negative: _negatives,
    m.Weather: _some(m.Weather),
    m.Quantity: lambda _: quantities(),
    m.Ref: lambda _: REFERENCES,
}
"""Strategies of classes whose fields depend on each other; they are given the depth that is left."""


def _beginnings() -> frozenset[tuple[type[m.Item], str]]:
    """Return the fields that are the first word of a condition or action, or a label: those are not any name."""
    found = {(m.When, "name"), (m.Expect, "name")}
    for kind in (*parts(m.Condition), *parts(m.Action), m.Measure):
        found |= {(kind, "actor")} & {(kind, name) for name in kind.model_fields}
    return frozenset(found)


_BEGINNINGS = _beginnings()


def may_be_word(hint: Any) -> bool:
    """Whether an annotation takes a word that may be a parameter's name: then the file must have that parameter.

    (Where quantities stand, a word can be nothing else.)
    """
    found = list(alternatives(_each(hint)))
    return m.Ref in found and m.Quantity not in found


def _each(hint: Any) -> Any:
    """Return what an annotation of a tuple says of each part; any other annotation as it is."""
    inner = get_args(hint)[0] if get_origin(hint) is Annotated else hint
    return get_args(inner)[0] if get_origin(inner) is tuple else hint


def settled(model: m.Definition) -> m.Definition:
    """Return the nearest model that a file can say: in a scenario every parameter referred to is there.

    In other files there are no parameters, so what would refer to one is a plain word. A word that is no parameter
    and cannot be quoted is not called like one.
    """
    if isinstance(model, m.Extension):  # any word may be a parameter of the scenario that it extends
        return _without_references(model, m.ANY_NAME, refer=True)
    if not isinstance(model, m.Scenario):
        return _without_references(model, frozenset(), refer=False)
    wanted = {ref.name for item in walk(model) for ref in _references(item)}
    known = {item.name for item in model.all(m.Param)}
    new = [m.Param(name=name, type="arm", default="south") for name in sorted(wanted - known)]
    whole = m.Scenario(name=model.name, body=(*new, *model.body))
    return _without_references(whole, frozenset(wanted | known), refer=True)


def _references(item: m.Item) -> Iterator[m.Ref]:
    for name, hint in hints(type(item)).items():
        value = getattr(item, name)
        if may_be_word(hint):
            yield from (part for part in (value if isinstance(value, tuple) else (value,)) if isinstance(part, m.Ref))


def _without_references(item: _T, parameters: frozenset[str], *, refer: bool) -> _T:
    changes: dict[str, Any] = {}
    for name, hint in hints(type(item)).items():
        value = getattr(item, name)
        if may_be_word(hint) and isinstance(value, m.Ref) and not refer:
            changes[name] = _plain_word(hint, value.name)
        elif may_be_word(hint) and isinstance(value, str) and value in parameters and _is_free(hint, value):
            changes[name] = m.Ref(name=value)
        elif isinstance(value, m.Item):
            changes[name] = _without_references(value, parameters, refer=refer)
        elif isinstance(value, tuple) and may_be_word(hint):
            changes[name] = tuple(
                _plain_word(_each(hint), part.name) if isinstance(part, m.Ref) and not refer else part for part in value
            )
        elif isinstance(value, tuple):
            changes[name] = tuple(
                _without_references(part, parameters, refer=refer) if isinstance(part, m.Item) else part
                for part in value
            )
    return item.model_copy(update=changes)


def _plain_word(hint: Any, name: str) -> str:
    others = [one for one in alternatives(hint) if one is str or get_origin(one) in (Annotated, Literal)]
    assume(others)  # what only a parameter can be is in no other file
    if get_origin(others[0]) is Literal:
        return str(get_args(others[0])[0])
    return name if m.ModelName not in others else "car.sedan"


def _is_free(hint: Any, word: str) -> bool:
    """Whether a word stands as it is: it is a name, not one of the language's own, and cannot be in quotes."""
    own = (word in get_args(one) for one in alternatives(hint) if get_origin(one) is Literal)
    quoted = {m.Id, m.Word} & set(alternatives(hint))
    return re.fullmatch(NAME_PATTERN, word) is not None and not any(own) and not quoted


# ---- from annotations to strategies ---------------------------------------------------------------------------------


def of(hint: Any, least: int = 0, *, depth: int = DEEPEST) -> Strategy:
    """Return a strategy for the values of an annotation.

    Args:
        hint: the annotation, `Annotated` and all.
        least: how many elements a tuple has at least.
        depth: how many times classes that can hold themselves may still do so.
    """
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is Annotated:
        limits = _limits(hint.__metadata__)
        least = max([least, *[limit.min_length for limit in limits if hasattr(limit, "min_length")]])
        if m.Quantity in list(alternatives(arguments[0])) and any(isinstance(limit, m.OfDimension) for limit in limits):
            return _validated_quantities(hint)
        return _strings(limits) if arguments[0] is str else of(arguments[0], least, depth=depth)
    if origin is Literal:
        return st.sampled_from(arguments)
    if origin in (Union, types.UnionType):
        flat = [one for one in arguments if depth > 0 or not _holds_itself(one)]
        return st.one_of([of(one, depth=depth) for one in flat])
    if origin is tuple:
        return st.lists(of(arguments[0], depth=depth), min_size=least, max_size=3).map(tuple)
    plain: dict[Any, Strategy] = {type(None): st.none(), bool: st.booleans(), str: texts}
    if hint in plain:
        return plain[hint]
    return _of_class(hint, depth)


def _holds_itself(hint: Any) -> bool:
    return isinstance(hint, type) and issubclass(hint, m.Item) and hint in _inside(hint)


@functools.cache
def _of_class(kind: type[m.Item], depth: int) -> Strategy:
    deeper = depth - _holds_itself(kind)
    return SPECIAL[kind](deeper) if kind in SPECIAL else _builds(kind, deeper)


def _builds(kind: type[m.Item], depth: int, **given: Strategy) -> Strategy:
    return _items(kind, _Fields(_field_strategies(kind, depth) | given))


@functools.cache
def _field_strategies(kind: type[m.Item], depth: int) -> dict[str, Strategy]:
    """Return a strategy for each field; made once, because Hypothesis checks every strategy that it has not seen."""
    fields = {}
    for name, hint in hints(kind).items():
        info = kind.model_fields[name]
        limits = [part for part in info.metadata if hasattr(part, "min_length")]
        if (kind, name) in _BEGINNINGS:
            fields[name] = of(hint, depth=depth).filter(lambda word: word not in _reserved())
        elif name != "kind" or not isinstance(info.default, str):
            fields[name] = of(hint, max([0, *[limit.min_length for limit in limits]]), depth=depth)
    return fields


class _Fields(dict[str, Any]):
    """Strategies by field, with a short name in Hypothesis's reports."""

    def __repr__(self) -> str:
        return "..."


@st.composite
def _items(draw: st.DrawFn, kind: type[m.Item], fields: dict[str, Any]) -> m.Item:
    return _made(kind, {name: draw(strategy) for name, strategy in fields.items()})


def _drawn(draw: st.DrawFn, kind: type[m.Item], given: dict[str, Any]) -> m.Item:
    """Draw an item some fields of which are given."""
    others = {name: strategy for name, strategy in _field_strategies(kind, 1).items() if name not in given}
    return _made(kind, given | {name: draw(strategy) for name, strategy in others.items()})


def _made(kind: type[m.Item], fields: dict[str, Any]) -> m.Item:
    try:
        return kind(**fields)
    except ValidationError:  # a validator of the whole class refuses this combination
        assume(False)
        raise


# ---- definitions with a certain statement ---------------------------------------------------------------------------

_BLOCKS = ("body", "actions")
"""The fields of the model whose elements are statements."""
_CALLED = {m.Ego: "actor", m.When: "trigger"}


def _hosts() -> dict[str, tuple[type[m.Item], str, tuple[type[m.Item], ...]]]:
    """Return the classes that have a block of statements: the class, the block's field, the statements' classes."""
    found = {}
    for kind in classes():
        for field in _BLOCKS:
            if field in kind.model_fields:
                default = kind.model_fields["kind"].default
                name = _CALLED.get(kind, default if isinstance(default, str) else kind.__name__.lower())
                found[name] = (kind, field, tuple(dict.fromkeys(parts(hints(kind)[field]))))
    return found


HOSTS = _hosts()
STATEMENTS = [(host, kind) for host, (_, _, kinds) in HOSTS.items() for kind in kinds]
"""Every statement, with the block that it stands in."""


@functools.cache
def _statements(host: str, kind: type[m.Item]) -> tuple[Strategy, Strategy]:
    """Return strategies for some statements of one kind, and for others that may stand in the same block."""
    kinds = HOSTS[host][2]
    others = st.one_of([of(other, depth=1) for other in kinds])
    return st.lists(of(kind), min_size=1, max_size=3), st.lists(others, max_size=2)


@st.composite
def definitions(draw: st.DrawFn, host: str, kind: type[m.Item]) -> m.Definition:
    """A definition with some statements of one kind, among others, in a block of one kind."""
    owner, field, _ = HOSTS[host]
    own, others = _statements(host, kind)
    item = _drawn(draw, owner, {field: (*draw(own), *draw(others))})
    while not isinstance(item, get_args(m.Definition)):
        outer = next(name for name, (o, _, inner) in HOSTS.items() if type(item) in inner and o is not type(item))
        owner, field, _ = HOSTS[outer]
        item = _drawn(draw, owner, {field: (item,)})
    assert isinstance(item, get_args(m.Definition))
    return settled(item)


def any_definition() -> st.SearchStrategy[m.Definition]:
    """Return definitions of all kinds, with every statement."""
    return st.sampled_from(STATEMENTS).flatmap(lambda pair: definitions(*pair))

"""Tables of the documentation that repeat what the code has: written from the code, or compared with its names.

`pytest tests/test_tables.py --rewrite-goldens` writes the rows of the first kind again. Tables of settings are compared
by `tests/test_docs.py`.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Iterable
from pathlib import Path

import pytest
import yaml

from foresee_dsl.derive.operators import operators
from foresee_dsl.derive.presets import PRESETS
from foresee_dsl.drivers.registry import DRIVERS
from foresee_dsl.forecast.registry import RANKERS
from foresee_dsl.language.codes import every_code
from foresee_dsl.language.model import OWNERS, PROPERTIES
from foresee_dsl.limits import LIMITS
from foresee_dsl.simulate.results.verdict import COLLISIONS
from foresee_dsl.simulate.rules.infraction import Rule
from tests.support.goldens import Golden

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"


def lints() -> Iterable[tuple[str, ...]]:
    for code in every_code().values():
        if code.code.startswith("FS3"):
            yield f"`{code.code}`", code.title, code.severity, " ".join(code.explanation.split())


def limits() -> Iterable[tuple[str, ...]]:
    return ((f"`{limit.name}`", f"{limit.default:.0f} {limit.unit}", limit.what) for limit in LIMITS.values())


def inputs_of_the_action() -> Iterable[tuple[str, ...]]:
    action = yaml.safe_load((ROOT / "action.yml").read_text(encoding="utf-8"))
    for name, value in action["inputs"].items():
        yield f"`{name}`", f"`{value['default']}`" if value["default"] else "", value["description"].rstrip(".")


WRITTEN: dict[tuple[str, str], Callable[[], Iterable[tuple[str, ...]]]] = {
    ("guide/checking.md", "| lint | reports | severity | explanation |"): lints,
    ("guide/security.md", "| limit | default | what it limits |"): limits,
    ("guide/ci.md", "| input | default | meaning |"): inputs_of_the_action,
}
"""The rows of a table, by its page and its first line."""


def rows_of(page: str, header: str) -> str:
    """Return the rows of a table, as they are in the page."""
    table = (DOCS / page).read_text(encoding="utf-8").partition(f"\n{header}\n")[2].partition("\n\n")[0]
    assert table, f"docs/{page} has no table with the first line {header}"
    return table.partition("\n")[2]


@pytest.mark.parametrize(("page", "header"), WRITTEN)
def test_a_table_is_as_the_code_writes_it(page: str, header: str, golden: Golden) -> None:
    cells = ([cell.replace("|", r"\|") for cell in row] for row in WRITTEN[page, header]())
    rows = "\n".join(f"| {' | '.join(row)} |".replace("|  |", "| |") for row in cells)
    text = (DOCS / page).read_text(encoding="utf-8")
    golden(text.replace(rows_of(page, header), rows), DOCS / page)


def plug_in_groups() -> set[str]:
    modules = (path for folder in ("foresee_dsl", "plugins") for path in (ROOT / folder).rglob("*.py"))
    group = re.compile(r'(?:PluginGroup\(|^GROUP = )"(foresee_dsl\.\w+)"', re.MULTILINE)
    return {name for module in modules for name in group.findall(module.read_text(encoding="utf-8"))}


def extras() -> set[str]:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return {*project["optional-dependencies"]} - {"lsp", "docs", "dev"}  # an old name, and those of developers


def changeable_in_clips() -> set[str]:
    owners = ((name, owner.properties or ("NAME",)) for name, owner in OWNERS.items() if not owner.not_in_clips)
    return {f"ACTOR.{name}" for name in PROPERTIES} | {f"{owner}.{name}" for owner, names in owners for name in names}


NAMED: dict[tuple[str, str], Callable[[], Iterable[str]]] = {
    ("reference/plug-ins.md", "| group | what it adds | description |"): plug_in_groups,
    ("reference/drivers.md", "| driver | what it is |"): lambda: (*DRIVERS.names(), *DRIVERS.missing()),
    ("reference/clips.md", "| changed | values | WAS, if the clip does not say it |"): changeable_in_clips,
    ("background/method.md", "| ranker | what it does |"): lambda: (*RANKERS.names(), *RANKERS.missing()),
    ("background/method.md", "| operator | what it changes | which actors | source |"): operators,
    ("background/method.md", "| preset | what its children are |"): lambda: PRESETS,
    ("background/method.md", "| rule | the ego breaks it when | source |"): lambda: Rule,
    ("background/method.md", "| kind | definition |"): lambda: COLLISIONS,
    ("start/install.md", "| extra | what it adds |"): extras,
}
"""All names that the first column of a table has, by the table's page and first line."""


@pytest.mark.parametrize(("page", "header"), NAMED)
def test_a_table_has_a_row_for_each_thing_that_the_code_has(page: str, header: str) -> None:
    cells = [row.split(" | ")[0].strip("| ") for row in rows_of(page, header).splitlines()]
    names = [name for cell in cells for name in re.findall("`([^`]+)`", cell) or [cell]]
    assert sorted(names) == sorted(NAMED[page, header]())

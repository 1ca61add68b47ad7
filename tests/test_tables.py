"""Tables of the documentation that repeat what the code has: written from it, or compared with its names.

`pytest tests/test_tables.py --rewrite-goldens` writes the rows of the first kind again, and the values
in tables of settings.
"""

from __future__ import annotations

import importlib
import math
import re
import tomllib
from collections.abc import Callable, Iterable
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import pytest
import yaml

from foresee_dsl.avoidance.candidates.behaviours import Kind
from foresee_dsl.derive.operators import operators
from foresee_dsl.derive.presets import PRESETS
from foresee_dsl.drivers.registry import DRIVERS
from foresee_dsl.forecast.registry import RANKERS
from foresee_dsl.language.codes import every_code
from foresee_dsl.language.model import OWNERS, PROPERTIES, USUAL
from foresee_dsl.language.project.loading import load_test_cases
from foresee_dsl.language.units import UNITS
from foresee_dsl.limits import LIMITS
from foresee_dsl.plugins import BESIDE, PluginGroup, package_of
from foresee_dsl.simulate.results.criticality import CriticalityMeasure
from foresee_dsl.simulate.results.infraction import Rule
from foresee_dsl.simulate.results.verdict import COLLISIONS
from tests.support.goldens import Golden

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = (ROOT / "README.md", *sorted(DOCS.rglob("*.md")))


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


def options_of_faults() -> Iterable[tuple[str, ...]]:
    from foresee_study.faults.__main__ import OPTIONS

    for flag, option in OPTIONS.items():
        default = option.get("default")
        usual = f"`{default:g}`" if isinstance(default, float) else f"`{default}`"
        usual = {math.inf: "no bound", None: "off"}.get(default, usual)
        yield f"`{flag}`", "all cores" if flag == "--jobs" else usual, option["help"]


WRITTEN: dict[tuple[str, str], Callable[[], Iterable[tuple[str, ...]]]] = {
    ("guide/checking.md", "| lint | reports | severity | explanation |"): lints,
    ("guide/security.md", "| limit | default | what it limits |"): limits,
    ("guide/ci.md", "| input | default | meaning |"): inputs_of_the_action,
    ("background/faults.md", "| option | default | meaning |"): options_of_faults,
}
"""The rows of a table, by its page and its first line."""


def rows_of(page: str, header: str) -> str:
    """Return the rows of a table, as they are in the page."""
    table = (DOCS / page).read_text(encoding="utf-8").partition(f"\n{header}\n")[2].partition("\n\n")[0]
    assert table, f"docs/{page} has no table with the first line {header}"
    return table.partition("\n")[2]


def cells_of(rows: str) -> list[list[str]]:
    return [[cell.strip() for cell in row.strip("|").split(" | ")] for row in rows.splitlines()]


def row_of(cells: Iterable[str]) -> str:
    return f"| {' | '.join(cells)} |".replace("|  |", "| |")


@pytest.mark.parametrize(("page", "header"), WRITTEN)
def test_a_table_is_as_the_code_writes_it(page: str, header: str, golden: Golden) -> None:
    cells = ([cell.replace("|", r"\|") for cell in row] for row in WRITTEN[page, header]())
    rows = "\n".join(map(row_of, cells))
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


def environment_variables() -> set[str]:
    modules = (path for path in (ROOT / "foresee_dsl").rglob("*.py"))
    names = {name for module in modules for name in re.findall(r"\bFORESEE_[A-Z_]+\b", module.read_text("utf-8"))}
    names |= {"FORESEE_WEIGHTS"}  # that of the learned drivers, which are plug-ins
    return names


def styles() -> set[str]:
    return {*PROPERTIES["style"].words} - {USUAL}


def ours(group: PluginGroup) -> Iterable[str]:
    """What the distributions of this repository offer; a developer of another plug-in may have that installed too."""
    packages = ("foresee-dsl", *(f"foresee-{extra}" for extra in BESIDE))
    return *(entry.name for entry in group.entries() if package_of(entry) in packages), *group.missing()


NAMED: dict[tuple[str, str], Callable[[], Iterable[str]]] = {
    ("reference/plug-ins.md", "| group | what it adds | description |"): plug_in_groups,
    ("reference/drivers.md", "| driver | what it is |"): lambda: ours(DRIVERS),
    ("reference/clips.md", "| changed | values | WAS, if the clip does not say it |"): changeable_in_clips,
    ("background/method.md", "| ranker | what it does |"): lambda: ours(RANKERS),
    ("background/method.md", "| operator | what it changes | which actors | source |"): operators,
    ("background/method.md", "| preset | what its children are |"): lambda: PRESETS,
    ("background/method.md", "| rule | the ego breaks it when | source |"): lambda: Rule,
    ("background/method.md", "| kind | definition |"): lambda: COLLISIONS,
    # time to collision and the braking needed are described in front of the table
    ("background/method.md", "| key | measure | value at a moment |"): lambda: (
        {*CriticalityMeasure} - {CriticalityMeasure.TTC, CriticalityMeasure.DRAC}
    ),
    ("background/rankers.md", "| behaviour | `operator` in a mutant | the change | which actors |"): lambda: Kind,
    ("reference/language.md", "| style | what changes in SUMO's models | effect |"): styles,
    ("start/install.md", "| extra | what it adds |"): extras,
    ("start/install.md", "| environment variable | meaning |"): environment_variables,
}
"""All names that the first column with code in a table has, by the table's page and first line."""


@pytest.mark.parametrize(("page", "header"), NAMED)
def test_a_table_has_a_row_for_each_thing_that_the_code_has(page: str, header: str) -> None:
    rows = cells_of(rows_of(page, header))
    column = next((k for k, cell in enumerate(rows[0]) if "`" in cell), 0)
    names = [name for row in rows for name in re.findall("`([^`]+)`", row[column]) or [row[column]]]
    assert sorted(names) == sorted(NAMED[page, header]())


# ---- settings -------------------------------------------------------------------------------------------------------

_TABLE = re.compile(r"Settings of ((?:`[\w.]+`(?:, | and )?)+):\n\n\| setting[^\n]*\n\| ---[^\n]*\n((?:\|[^\n]*\n)+)")
_SCALE = {"%": 0.01, "deg/s": math.pi / 180, **{word: unit.to_si for word, unit in UNITS.items()}}


def tables() -> list[tuple[Path, tuple[str, ...], str]]:
    """Every table of settings: its page, what it is about, and its rows as they are in the page."""
    texts = ((page, page.read_text(encoding="utf-8")) for page in PAGES)
    return [
        (page, tuple(re.findall(r"`([\w.]+)`", names)), rows)
        for page, text in texts
        for names, rows in _TABLE.findall(text)
    ]


def resolved(name: str) -> Any:
    """Return what a dotted name stands for: a module, a class's defaults, or an object."""
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError:
        module, _, attribute = name.rpartition(".")
        found = getattr(importlib.import_module(module), attribute)
        return found() if isinstance(found, type) else found


def written(cell: str) -> Any:
    """Return a cell's value in SI: a number with its unit, a quoted word, several of either, yes or no, or None."""
    if cell == "none":
        return None
    if cell in ("yes", "no"):
        return cell == "yes"
    if "; " in cell:
        return tuple(written(part) for part in cell.split("; "))
    if "`" in cell:
        return cell.strip("`")
    number, _, unit = cell.partition(" ")
    return float(number) * (_SCALE[unit] if unit else 1.0)


def in_code(owner: Any, path: str) -> Any:
    for part in path.split("."):
        owner = getattr(owner, part)
    return None if owner in ((), "") else owner


def same(said: Any, value: Any) -> bool:
    if isinstance(value, tuple) and all(isinstance(part, str) for part in value):
        return bool(said == "+".join(value))
    if isinstance(value, tuple):
        said = said if isinstance(said, tuple) else (said,)
        return len(said) == len(value) and all(map(same, said, value))
    if isinstance(value, bool):
        return said is value
    if isinstance(value, (int, float)):
        return isinstance(said, float) and math.isclose(said, value, rel_tol=1e-4, abs_tol=1e-12)
    return bool(said == value)


def cell_for(value: Any, cell: str) -> str:
    """Return a cell that says a value, in the unit of the present cell; the present cell if that says the value."""
    if same(written(cell), value):
        return cell
    if value is None:
        return "none"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, (int, float)):
        unit = cell.partition(" ")[2]
        return f"{float(f'{value / _SCALE.get(unit, 1.0):.5g}'):.10g} {unit}".strip()
    if isinstance(value, str) or all(isinstance(part, str) for part in value):
        return f"`{value if isinstance(value, str) else '+'.join(value)}`"
    cells = cell.split("; ")
    return "; ".join(map(cell_for, value, cells + cells[-1:] * len(value)))


TABLES = tables()
IDS = [", ".join(names) for _, names, _ in TABLES]


@pytest.mark.parametrize(("page", "names", "rows"), TABLES, ids=IDS)
def test_tables_say_what_the_code_says(page: Path, names: tuple[str, ...], rows: str, golden: Golden) -> None:
    owners = [resolved(name) for name in names]
    lines = []
    for setting, *cells in cells_of(rows):
        values = (in_code(owner, setting.strip("`")) for owner in owners)
        lines.append(row_of([setting, *map(cell_for, values, cells), *cells[len(owners) :]]) + "\n")
    golden(page.read_text(encoding="utf-8").replace(rows, "".join(lines)), page)


@pytest.mark.parametrize(("page", "names", "rows"), TABLES, ids=IDS)
def test_tables_are_complete(page: Path, names: tuple[str, ...], rows: str) -> None:
    described = {row[0].strip("`") for row in cells_of(rows)}
    for name in names:
        missing = set(settings_of(resolved(name))) - described
        assert not missing, f"{page} says nothing of {sorted(missing)} of {name}"


def settings_of(owner: Any) -> list[str]:
    """Return the names of all settings: a dataclass's fields (with those of its parts), a module's own numbers."""
    if not is_dataclass(owner):
        source = Path(owner.__file__).read_text(encoding="utf-8")
        groups = re.findall(r"^([A-Z][A-Z0-9_]*(?:, [A-Z][A-Z0-9_]*)*)(?:: [^=\n]+)? = ", source, re.M)
        own = [name for group in groups for name in group.split(", ")]
        return [name for name in own if isinstance(getattr(owner, name), (int, float))]
    names = []
    for field in fields(owner):
        value = getattr(owner, field.name)
        names += [f"{field.name}.{part}" for part in settings_of(value)] if is_dataclass(value) else [field.name]
    return names


def test_every_stage_has_its_table() -> None:
    described = {name for _, names, _ in TABLES for name in names}
    assert described >= {
        "foresee_dsl.campaign.settings.CampaignSettings",
        "foresee_dsl.forecast.settings.ForeseeSettings",
        "foresee_dsl.derive.presets.PAPER",
        "foresee_dsl.derive.presets.FOCUSED",
        "foresee_dsl.simulate.results.outcome",
        "foresee_dsl.kernels.constants",
        "foresee_dsl.simulate.actors.bend_speeds",
        "foresee_dsl.simulate.actors.target_selection",
        "foresee_dsl.simulate.results.near_misses",
        "foresee_dsl.simulate.actors.lane_recovery",
        "foresee_dsl.simulate.actors.lane_recovery.RecoverySettings",
        "foresee_dsl.simulate.runner",
        "foresee_dsl.simulate.sensing.IDEAL",
        "foresee_dsl.simulate.sensing.STANDARD",
        "foresee_dsl.simulate.mission",
        "foresee_dsl.simulate.sensing.weather",
    }


def test_the_library_is_listed_file_by_file(scenarios: Path) -> None:
    page = (DOCS / "reference" / "library.md").read_text(encoding="utf-8")
    listed = {name: int(count) for name, count in re.findall(r"^\| `(scenario[\w/]+)` \| (\d+) \|", page, re.M)}
    files = [*scenarios.glob("scenario*/*.foresee"), *scenarios.glob("scenario*.foresee")]
    assert listed == {str(f.relative_to(scenarios).with_suffix("")): len(load_test_cases([f])) for f in files}
    for family, count in re.findall(r"^## Family (\d): (\d+) cases$", page, re.M):
        assert sum(n for name, n in listed.items() if name.startswith(f"scenario{family}")) == int(count)
    assert f"{sum(listed.values())} test cases" in page

"""Reads a campaign's file, such as `campaign nightly { seeds "scenarios/**"; drivers [pdm, idm]; budget 30 min }`."""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import get_type_hints

from foresee_dsl.campaign.goal import problem_with
from foresee_dsl.campaign.settings import CampaignSettings
from foresee_dsl.derive.presets import PRESETS
from foresee_dsl.drivers.registry import DRIVERS, name_in
from foresee_dsl.errors import Diagnostic, InputError, with_article
from foresee_dsl.files import absolute
from foresee_dsl.forecast.registry import RANKERS
from foresee_dsl.helps import HelpText
from foresee_dsl.language import model as m
from foresee_dsl.language.campaign_values import RulesMode
from foresee_dsl.language.document import Document
from foresee_dsl.language.messages.suggest import did_you_mean
from foresee_dsl.language.project.addresses import (
    SUFFIX,
    is_folder,
    is_inside,
    kind_of,
    parse_address,
    project_folder,
    scenario_files,
)
from foresee_dsl.language.project.loading import Project, load_test_cases

NOBODY = "none"
"""The word in a campaign's file that means no reference driver."""
_PATTERN = frozenset("*?[")
_BEGIN = "paths begin at this file's own folder"


@dataclass(frozen=True)
class CampaignFile:
    """The contents of a campaign's file.

    Attributes:
        paths: its test cases: files and addresses, as on a command line.
        drivers, rankers: empty if the file names none.
        settings: the settings in the file, by the names of `CampaignSettings`.
        against: the reference drivers; None if the file does not state them.
        budget_s: time after which no new run begins, s; None: no limit.
    """

    name: str
    paths: tuple[str, ...]
    drivers: tuple[str, ...]
    rankers: tuple[str, ...]
    settings: Mapping[str, float | int | str]
    against: tuple[str, ...] | None
    budget_s: float | None


def is_campaign(path: str) -> bool:
    """Return whether a path on the command line names a campaign's file."""
    return os.path.isfile(path) and kind_of(Path(path)) == "campaign"  # noqa: PTH113 - paths may be no file names


def read_campaign(path: Path, *, allow_outside: bool = False) -> CampaignFile:
    """Read a campaign's file; `allow_outside`: its test cases may lie outside the file's project folder.

    Raises:
        InputError: it has errors, or names something that does not exist (see `mistakes_of`).
    """
    document = Project().document(path)
    model = document.model
    if not isinstance(model, m.Campaign):
        raise InputError(
            (document.diagnostic(model, "", "FS132", f"the file contains a {model.kind}, not a campaign"),)
        )
    if mistakes := mistakes_of(document, allow_outside=allow_outside):
        raise InputError(mistakes)
    seeds = (item for item in model.body if isinstance(item, m.Seeds))
    budget = next((item.time.si for item in model.body if isinstance(item, m.Budget)), None)
    return CampaignFile(
        name=model.name,
        paths=tuple(dict.fromkeys(file for item in seeds for file in _paths(item, path.parent))),
        drivers=next((item.names for item in model.body if isinstance(item, m.Drivers)), ()),
        rankers=next((item.names for item in model.body if isinstance(item, m.Rankers)), ()),
        settings=dict(_settings(model, path.parent)),
        against=next((item.names for item in model.body if isinstance(item, m.Against)), None),
        budget_s=budget,
    )


def mistakes_of(document: Document, *, allow_outside: bool = False, with_goal: bool = False) -> tuple[Diagnostic, ...]:
    """Return an error for each missing driver, ranker, preset, test case and folder that a campaign's file names.

    What lies outside its project folder is an error too, unless `allow_outside`; its folders are not even read.
    `with_goal`: also for a goal that no test case has, for which all test cases are loaded (2 s for 120), and for a
    driver that is its own reference; both depend on statements that options of a command replace.
    """
    if not isinstance(document.model, m.Campaign):
        return ()
    mistakes = tuple(_mistakes(document, document.model, allow_outside=allow_outside))
    if mistakes or not with_goal:
        return mistakes
    goal = _mistakes_of_goal(document, document.model, allow_outside=allow_outside)
    return (*_mistakes_of_references(document, document.model), *goal)


def _mistakes(document: Document, campaign: m.Campaign, *, allow_outside: bool) -> Iterator[Diagnostic]:
    folder = Path(document.path).parent
    for item in campaign.body:
        if isinstance(item, m.Drivers | m.Against | m.Rankers):
            ranks = isinstance(item, m.Rankers)
            what, installed = ("ranker", RANKERS.names()) if ranks else ("driver", DRIVERS.names())
            for k, name in enumerate(item.names):
                plain = name if ranks else name_in(name)
                nobody = isinstance(item, m.Against) and item.names == (NOBODY,)
                if plain not in installed and not nobody:
                    message, help_ = f"no {what} '{plain}' is installed", did_you_mean(plain, installed)
                    if isinstance(item, m.Against) and plain == NOBODY:
                        message, help_ = f"`{NOBODY}` stands beside drivers", f"remove it, or write only `{NOBODY}`"
                    yield document.diagnostic(item, f"names.{k}", "FS058", message, help_)
        elif isinstance(item, m.Preset) and item.name not in PRESETS:
            message, help_ = f"there is no preset '{item.name}'", did_you_mean(item.name, PRESETS)
            yield document.diagnostic(item, "name", "FS058", message, help_)
        elif isinstance(item, m.Seeds | m.FirstFrom) and not allow_outside and _leads_outside(item.path, folder):
            message = f"'{item.path}' is outside the project folder '{project_folder(absolute(folder)).as_posix()}'"
            help_ = "move the files there, or allow it with `--allow-outside`"
            yield document.diagnostic(item, "path", "FS138", message, help_)
        elif isinstance(item, m.Seeds) and not _paths(item, folder):
            yield document.diagnostic(item, "path", "FS059", f"no scenario matches '{item.path}'", _BEGIN)
        elif isinstance(item, m.Seeds) and (wrong := _wrong_seeds(item, folder, allow_outside=allow_outside)):
            yield document.diagnostic(item, "path", "FS059", *wrong)
        elif isinstance(item, m.FirstFrom) and not os.path.isdir(folder / item.path):  # noqa: PTH112 - see is_campaign
            message = f"there is no folder '{item.path}'"
            help_ = "name the folder of a campaign, or of kept failures; paths begin at this file's own folder"
            yield document.diagnostic(item, "path", "FS059", message, help_)


def _mistakes_of_goal(document: Document, campaign: m.Campaign, *, allow_outside: bool) -> Iterator[Diagnostic]:
    """Yield the error of a goal that no test case has; test cases with errors of their own are reported elsewhere."""
    goal = next(iter(campaign.all(m.SearchGoal)), None)
    if goal is None:
        return
    folder = Path(document.path).parent
    paths = [path for seeds in campaign.all(m.Seeds) for path in _paths(seeds, folder)]
    try:
        cases = load_test_cases(paths, allow_outside=allow_outside)
    except InputError:
        return
    if (problem := problem_with(cases, goal.name)) is not None:
        yield document.diagnostic(goal, "name", "FS058", *problem)


def _mistakes_of_references(document: Document, campaign: m.Campaign) -> Iterator[Diagnostic]:
    """Yield the error of a campaign of one driver whose only reference driver is that driver."""
    drivers = {name for item in campaign.all(m.Drivers) for name in item.names}
    for item in campaign.all(m.Against):
        if len(drivers) == 1 and set(item.names) == drivers:
            yield document.diagnostic(item, "names.0", "FS058", *own_reference(item.names[0]))


def own_reference(driver: str) -> tuple[str, str]:
    """Return the message about a driver that is its own and only reference driver, and what to do."""
    message = f"{driver} is the driver under test, which cannot be its own reference"
    return message, f"name another, or `{NOBODY}`"


def _wrong_seeds(item: m.Seeds, folder: Path, *, allow_outside: bool) -> tuple[str, HelpText] | None:
    """Return the message and the help for a `seeds` line whose file or folder holds no such test case.

    A file that has errors of its own is not at fault here: a check of that file, or the run, reports them.
    """
    written, case = parse_address(item.path)
    file = folder / written
    if _PATTERN & set(item.path):
        return None  # only scenarios match
    if is_folder(file):
        scenarios = any(kind_of(path) in ("scenario", "") for path in scenario_files([file]))
        return None if scenarios else (f"there is no scenario in folder '{item.path}'", _BEGIN)
    kind = kind_of(file)
    if kind in ("network", "models", "campaign"):
        message = f"'{written}' holds {with_article(kind)}, not a test case"
        return message, "name a scenario, or a folder or pattern of scenarios"
    names = _cases(file, allow_outside=allow_outside) if case is not None and kind == "scenario" else None
    if case is None or names is None or case in names:
        return None
    return f"'{written}' has no case '{case}'", did_you_mean(case, names) or "it has no cases: leave out the case"


def _cases(file: Path, *, allow_outside: bool) -> tuple[str, ...] | None:
    """Return the names of a scenario's cases; None if its file has errors."""
    try:
        scenario = Project(allow_outside=allow_outside).whole_scenario(file)
    except InputError:
        return None
    return tuple(case.name for case in scenario.all(m.Case))


def _leads_outside(path: str, folder: Path) -> bool:
    """Return whether a path or pattern may lead to files outside the project folder of the campaign's file.

    A pattern is judged by the part before its first wildcard; after that it may not contain `..`.
    """
    fixed, pattern = _divided(path) if _PATTERN & set(path) else (parse_address(path)[0], ())
    projects = (project_folder(absolute(folder)), project_folder(absolute(Path())))
    return ".." in pattern or not is_inside(absolute(folder / fixed), projects)


def _divided(path: str) -> tuple[Path, tuple[str, ...]]:
    """Return the path before the first wildcard of a pattern, and the remaining parts."""
    parts = Path(path).parts
    fixed = tuple(itertools.takewhile(lambda part: not _PATTERN & set(part), parts))
    return Path(*fixed), parts[len(fixed) :]


def _paths(item: m.Seeds, folder: Path) -> tuple[str, ...]:
    """Return the scenarios of a `seeds` line: for a pattern all matches, sorted.

    A file, folder or address is returned as written.
    """
    if not _PATTERN & set(item.path):
        file, case = parse_address(item.path)
        at = str(folder / file)
        return (f"{at}::{case}" if case else at,) if os.path.exists(at) else ()  # noqa: PTH110 - see is_campaign
    fixed, pattern = _divided(item.path)
    base = folder / fixed
    matches = sorted(base / path for path in _under(base, pattern) if path.name.endswith(SUFFIX))
    return tuple(str(file) for file in matches if kind_of(file) == "scenario")


def _under(base: Path, pattern: tuple[str, ...]) -> Iterator[Path]:
    """Yield the files under a folder that match a pattern, relative to it; hidden files and linked folders excluded."""
    for at, folders, names in os.walk(base):
        here = Path(at).relative_to(base)
        deep = "**" in pattern or len(here.parts) + 1 < len(pattern)
        folders[:] = [name for name in folders if deep and not name.startswith(".")]
        yield from (here / name for name in names if not name.startswith(".") and _fits((*here.parts, name), pattern))


def _fits(parts: Sequence[str], pattern: Sequence[str]) -> bool:
    """Return whether the parts of a path match those of a pattern; `**` matches any number of parts."""
    if not pattern:
        return not parts
    if pattern[0] == "**":
        return any(_fits(parts[k:], pattern[1:]) for k in range(len(parts) + 1))
    return bool(parts) and fnmatchcase(parts[0], pattern[0]) and _fits(parts[1:], pattern[1:])


def _settings(campaign: m.Campaign, folder: Path) -> Iterator[tuple[str, float | int | str]]:
    """Yield the settings that the statements of a campaign set, each with its value; paths begin at `folder`."""
    kinds = get_type_hints(CampaignSettings)
    for item in campaign.body:
        for name, setting in getattr(item, "sets", {}).items():
            value = getattr(item, name)
            if isinstance(value, m.Quantity):
                yield setting, int(value.si) if kinds[setting] is int else value.si
            elif isinstance(item, m.FirstFrom):
                yield setting, (folder / value).as_posix()
            else:
                yield setting, RulesMode(value) if kinds[setting] is RulesMode else value

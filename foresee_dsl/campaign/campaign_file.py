"""A campaign's file, read: `campaign nightly { seeds "scenarios/**"; drivers [pdm, idm]; budget 30 min }`."""

from __future__ import annotations

import glob
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from foresee_dsl.derive.presets import PRESETS
from foresee_dsl.drivers.registry import driver_names
from foresee_dsl.errors import Diagnostic, InputError
from foresee_dsl.forecast.registry import ranker_names
from foresee_dsl.language import model as m
from foresee_dsl.language.messages.suggest import did_you_mean
from foresee_dsl.language.project.addresses import kind_of, parse_address
from foresee_dsl.language.project.document import Document
from foresee_dsl.language.project.loading import Project

NOT_INSTALLED, NOTHING_THERE = "FS058", "FS059"

_PATTERN = frozenset("*?[")


@dataclass(frozen=True)
class CampaignFile:
    """The contents of a campaign's file.

    Attributes:
        paths: its test cases: files and addresses, as a command line would name them.
        drivers, rankers: empty where the file names none.
        given: the settings in the file, by the names of `CampaignSettings`.
        budget_s: no new run begins later than that; None: no bound.
    """

    name: str
    paths: tuple[str, ...]
    drivers: tuple[str, ...]
    rankers: tuple[str, ...]
    given: Mapping[str, float | int | str]
    budget_s: float | None


def is_campaign(path: str) -> bool:
    """Return whether a command line's path names a campaign's file."""
    return os.path.isfile(path) and kind_of(Path(path)) == "campaign"  # noqa: PTH113 - paths may be no file names


def read_campaign(path: Path) -> CampaignFile:
    """Read a campaign's file.

    Raises:
        InputError: it has errors, or names what is not there (see `mistakes_of`).
    """
    document = Project().document(path)
    model = document.model
    if not isinstance(model, m.Campaign):
        raise InputError((document.diagnostic(model, "", "FS132", f"this is a {model.kind}, not a campaign"),))
    if mistakes := mistakes_of(document):
        raise InputError(mistakes)
    seeds = (item for item in model.body if isinstance(item, m.Seeds))
    budget = next((item.time.si for item in model.body if isinstance(item, m.Budget)), None)
    return CampaignFile(
        name=model.name,
        paths=tuple(dict.fromkeys(file for item in seeds for file in _paths(item, path.parent))),
        drivers=next((item.names for item in model.body if isinstance(item, m.Drivers)), ()),
        rankers=next((item.names for item in model.body if isinstance(item, m.Rankers)), ()),
        given=dict(_settings(model)),
        budget_s=budget,
    )


def mistakes_of(document: Document) -> tuple[Diagnostic, ...]:
    """Return what a campaign's file names that is not there: drivers, rankers, its preset, its test cases."""
    return tuple(_mistakes(document, document.model)) if isinstance(document.model, m.Campaign) else ()


def _mistakes(document: Document, campaign: m.Campaign) -> Iterator[Diagnostic]:
    for item in campaign.body:
        if isinstance(item, m.Drivers | m.Rankers):
            what, known = ("driver", driver_names()) if isinstance(item, m.Drivers) else ("ranker", ranker_names())
            for k, name in enumerate(item.names):
                plain = name.partition(":")[0]
                if plain not in known:
                    message, help_ = f"no {what} '{plain}' is installed", did_you_mean(plain, known)
                    yield document.diagnostic(item, f"names.{k}", NOT_INSTALLED, message, help_)
        elif isinstance(item, m.Preset) and item.name not in PRESETS:
            message, help_ = f"no preset '{item.name}' is known", did_you_mean(item.name, PRESETS)
            yield document.diagnostic(item, "name", NOT_INSTALLED, message, help_)
        elif isinstance(item, m.Seeds) and not _paths(item, Path(document.path).parent):
            message, help_ = f"no scenario matches '{item.path}'", "paths begin at this file's own folder"
            yield document.diagnostic(item, "path", NOTHING_THERE, message, help_)


def _paths(item: m.Seeds, folder: Path) -> tuple[str, ...]:
    """What a `seeds` line means: a pattern's scenarios, sorted; a file, folder or address as it is."""
    if not _PATTERN & set(item.path):
        file, case = parse_address(item.path)
        at = str(folder / file)
        return (f"{at}::{case}" if case else at,) if os.path.exists(at) else ()  # noqa: PTH110 - see is_campaign
    matches = sorted(glob.glob(item.path, root_dir=folder, recursive=True))  # noqa: PTH207 - `**` matches files too
    files = (folder / name for name in matches if name.endswith(".foresee"))
    return tuple(str(file) for file in files if kind_of(file) == "scenario")


def _settings(campaign: m.Campaign) -> Iterator[tuple[str, float | int | str]]:
    for item in campaign.body:
        if isinstance(item, m.Preset):
            yield "preset", item.name
        elif isinstance(item, m.ClipAround):
            yield "before", item.before.si
            yield "after", item.after.si
        elif isinstance(item, m.RiskyPoints):
            yield "risky_points", int(item.count.si)
        elif isinstance(item, m.Children):
            yield "children", int(item.count.si)
        elif isinstance(item, m.Repeat):
            yield "repeat", int(item.times.si)
        elif isinstance(item, m.FirstSeed):
            yield "seed", int(item.seed.si)

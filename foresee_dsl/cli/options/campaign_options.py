"""The options that `campaign` and `plan` share, and the request that they result in."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, fields, is_dataclass
from functools import update_wrapper
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args, get_origin, get_type_hints

import typer
from typer.models import OptionInfo

from foresee_dsl.campaign.settings import OPTION, CampaignLimits, CampaignSettings, SettingOption
from foresee_dsl.campaign.workers import CPUS
from foresee_dsl.cli.completion import case_addresses
from foresee_dsl.cli.options import common
from foresee_dsl.report.safe_text import counted

if TYPE_CHECKING:
    from foresee_dsl.campaign.settings import Shard
    from foresee_dsl.campaign.storage.store import Store
    from foresee_dsl.campaign.workers.pool import Executor, RunOptions
    from foresee_dsl.drivers.protocol import Driver

Jobs = Annotated[int, common.jobs_option("Worker processes.")]
StoreOption = Annotated[
    Path | None, typer.Option("--store", help="Folder in which results are stored; by default OUT/store.")
]
ShardOption = Annotated[
    str,
    typer.Option(
        "--shard",
        metavar="K/N",
        help="Run only the K-th of N parts of the campaign, for job arrays; all/N joins the N parts.",
    ),
]
ExecutorOption = Annotated[
    str,
    typer.Option(
        "--executor", help="Where the runs are computed: local (processes on this machine) or dask (a cluster)."
    ),
]
SchedulerOption = Annotated[
    str,
    typer.Option("--scheduler", help="Address of the Dask scheduler; by default a cluster is started on this machine."),
]
Paths = Annotated[
    list[str],
    typer.Argument(
        metavar="PATH",
        help="Scenario files, folders, or test cases (FILE::CASE); or one campaign's file.",
        autocompletion=case_addresses,
    ),
]


SHARED: Mapping[str, Any] = MappingProxyType(
    {
        "driver": common.DriverOption,
        "ranker": common.RankerOption,
        "preset": common.PresetOption,
        "handover_s": common.HandoverOption,
        "rules": common.RulesOption,
        "seed": common.SeedOption,
    }
)
"""The options that other commands have too, by the names of `CampaignSettings`."""
_ORDER = ("driver", "ranker", "preset", "before", "after", "risky_points", "children", "handover", "repeat",
          "allocation", "first_from", "goal", "against", "rules")  # fmt: skip
"""The order of the settings' options in `--help-all`; settings that are not listed follow, and then all other options.
"""
_AFTER_JOBS = "seed"
"""The one setting that stands among the other options."""
EMPTY = "it is empty: name one, or leave the option out"
"""What is wrong with an option that must name something."""


def options_of_settings(settings: type = CampaignSettings) -> dict[str, inspect.Parameter]:
    """Return the options of settings, a dataclass, as parameters by name, in the order of the fields.

    Raises:
        TypeError: a setting has no option.
    """
    kinds = get_type_hints(settings)
    options = {}
    for setting in fields(settings):
        own: SettingOption | None = setting.metadata.get(OPTION)
        if own is None and setting.name not in SHARED:
            if OPTION in setting.metadata:
                continue
            raise TypeError(f"the setting {setting.name} has no option: add `metadata=option(help)`")
        by_driver = own.by_driver if own is not None else setting.name == "handover_s"
        default = None if by_driver else _text_of(setting.default)
        name = option_name(setting.name)
        kind = _option(setting.name, own, kinds[setting.name], default) if own is not None else SHARED[setting.name]
        options[name] = inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, annotation=kind, default=default)
    return options


def option_name(setting: str) -> str:
    """Return the name of a setting's option as a parameter: `before` for `before_s`."""
    return setting.removesuffix("_s")


def settings_of(settings: Any, values: Mapping[str, Any]) -> Any:  # noqa: ANN401 - a dataclass
    """Return settings, a dataclass, from the values of their options; a setting without a value has its default.

    Raises:
        BadParameter: a value is not one of the setting's words, or a list is empty.
    """
    chosen = {f.name: values[option_name(f.name)] for f in fields(settings) if option_name(f.name) in values}
    kinds = get_type_hints(settings)
    for name, value in chosen.items():
        if isinstance(value, str) and kinds[name] is not str and get_origin(kinds[name]) is not Literal:
            chosen[name] = common.names_in(value)
            if not chosen[name]:
                raise typer.BadParameter(EMPTY, param_hint=_typed(option_name(name)))
    _refuse_other_words(settings, chosen)
    return settings(**{name: value for name, value in chosen.items() if value is not None})


def _text_of(default: object) -> Any:  # noqa: ANN401 - as typer takes it
    """Return the default of an option: the names of a list are one text, that of an empty list is None."""
    return ", ".join(default) or None if isinstance(default, tuple) else default


def _option(name: str, option: SettingOption, kind: Any, default: object) -> Any:  # noqa: ANN401 - types
    """Return the annotation of a parameter by which typer makes an option. Lists and choices are texts at first."""
    kind = kind if kind in (int, float, str, bool) else str
    names = [_typed(option_name(name))] if kind is bool else []  # one name: without it there would be a `--no-` too
    info = typer.Option(
        *names, min=option.low, max=option.high, help=option.help, metavar=option.metavar or None,
        show_default=option.shows_default,
    )  # fmt: skip
    return Annotated[kind | None if default is None else kind, info]


@dataclass(frozen=True)
class Flags:
    """The options of `campaign` and `plan`, in the order of their help.

    `settings`: the values of the options of `CampaignSettings`, by the names of the options.
    """

    settings: Mapping[str, Any]
    jobs: Jobs = CPUS
    out: common.OutOption = Path("out")
    store: StoreOption = None
    first: common.FirstOption = None
    only: common.OnlyOption = None
    shard: ShardOption = ""
    allow_outside: common.AllowOutsideOption = False
    run_programs: Annotated[
        bool, typer.Option("--run-programs", help="Start the programs that the campaign's file names as drivers.")
    ] = False

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> Flags:
        """Return the record of the values of all its options by name."""
        others = {f.name: values[f.name] for f in fields(cls) if f.name in values}
        return cls({name: value for name, value in values.items() if name not in others}, **others)

    @property
    def store_folder(self) -> Path:
        """The store's folder."""
        return self.store or self.out / "store"


@dataclass(frozen=True)
class LimitFlags:
    """The options of commands that run campaigns or fuzz about the limits of their runs, in the order of their help."""

    step_deadline: common.StepDeadlineOption = None
    deadline: common.DeadlineOption = None
    memory: Annotated[float, typer.Option("--memory", min=100, help="Memory limit of a worker, in MB.")] = (
        CampaignLimits.memory_mb
    )
    budget: Annotated[
        float | None, typer.Option("--budget", min=0, help="Time in minutes after which no new run begins.")
    ] = None
    retry: Annotated[bool, typer.Option("--retry", help="Repeat runs that crashed or hung in an earlier campaign.")] = (
        False
    )

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> LimitFlags:
        """Return the record of the values of all its options by name."""
        return cls(**values)

    def within(self, budget_min: float | None) -> CampaignLimits:
        """Return the limits, with a time budget in minutes, or None."""
        budget_s = None if budget_min is None else budget_min * 60
        return CampaignLimits(self.deadline, self.memory, budget_s, self.step_deadline)


USUAL = ("driver", "children", "jobs", "out", "fail_fast", "json", "format", "help_all")
"""Names of the options that `--help` shows; `--help-all` shows all. Ours: what a first campaign needs, on 40 lines."""


def _show_all(ctx: typer.Context, value: bool) -> None:
    """Print the help with all options."""
    if value:
        for parameter in ctx.command.params:
            setattr(parameter, "hidden", False)  # noqa: B010 - an option's attribute, which arguments lack in the types
        typer.echo(ctx.get_help())
        raise typer.Exit


HelpAllOption = Annotated[
    bool, typer.Option("--help-all", is_eager=True, callback=_show_all, help="Show all options.", show_default=False)
]


def _hidden(option: inspect.Parameter) -> inspect.Parameter:
    """Return an option of a command that `--help` does not show, unless it is a usual one."""
    kind = option.annotation
    infos = [info for info in getattr(kind, "__metadata__", ()) if isinstance(info, OptionInfo)]
    if not infos or option.name in USUAL:
        return option
    info = copy(infos[0])
    info.hidden = True
    return option.replace(annotation=Annotated[get_args(kind)[0], info])


def with_flags(command: Callable[..., None]) -> Callable[..., None]:
    """Return a command in which typer options replace each parameter whose type is a dataclass: `Flags`, `LimitFlags`,
    or settings whose fields have options. There is one option for each field and each setting.

    Typer reads a function's signature, so the new command carries a signature of its own. If it has `--help-all`, its
    help shows only the usual options.
    """
    own = inspect.signature(command, eval_str=True).parameters
    groups = {
        name: (parameter.annotation, _options_in(parameter.annotation))
        for name, parameter in own.items()
        if is_dataclass(parameter.annotation)
    }

    def run(**values: Any) -> None:  # noqa: ANN401 - as typer gives them
        for name, (kind, options) in groups.items():
            own_values = {option.name: values.pop(option.name) for option in options}
            values[name] = kind.of(own_values) if kind in (Flags, LimitFlags) else settings_of(kind, own_values)
        command(**values)

    update_wrapper(run, command)
    every = [option for name in own for option in (groups[name][1] if name in groups else [own[name]])]
    every = [option.replace(kind=inspect.Parameter.KEYWORD_ONLY) for option in every]
    if "help_all" in own:
        every = [_hidden(option) for option in every]
    run.__signature__ = inspect.Signature(every)  # type: ignore[attr-defined]  # functions may have one
    run.__annotations__ = {option.name: option.annotation for option in every}
    return run


def _options_in(kind: Any) -> list[inspect.Parameter]:  # noqa: ANN401 - a dataclass
    """Return the options of a record of options or settings, in the order of the help."""
    if kind not in (Flags, LimitFlags):
        return list(options_of_settings(kind).values())
    kinds, keyword = get_type_hints(kind, include_extras=True), inspect.Parameter.KEYWORD_ONLY
    others = [inspect.Parameter(f.name, keyword, annotation=kinds[f.name], default=f.default)
              for f in fields(kind) if f.name != "settings"]  # fmt: skip
    if kind is LimitFlags:
        return others
    settings = options_of_settings()
    ordered = sorted(settings, key=lambda name: _ORDER.index(name) if name in _ORDER else len(_ORDER))
    first = [settings[name] for name in ordered if name != _AFTER_JOBS]
    return [*first, others[0], settings[_AFTER_JOBS], *others[1:]]


@dataclass(frozen=True)
class Request:
    """What the command line, and the campaign file that it names, request.

    Attributes:
        paths: the test cases.
        settings: one entry per driver and ranker.
        budget_min: time budget in minutes, or None.
        notes: sentences on settings of which a user may expect something else.
    """

    paths: list[str]
    settings: tuple[CampaignSettings, ...]
    budget_min: float | None = None
    notes: tuple[str, ...] = ()

    def folder(self, settings: CampaignSettings, out: Path) -> Path:
        """Return the folder of a campaign's results: `out`, or a subfolder per driver and ranker if there are
        several."""
        if len(self.settings) == 1:
            return out
        return out / re.sub(r"[^\w.-]+", "_", f"{settings.driver}_{settings.ranker}").strip("_")


def requested(ctx: typer.Context, paths: list[str], flags: Flags, budget: float | None = None) -> Request:
    """Return the checked request: unknown names are reported before anything runs.

    A campaign file provides settings; those on the command line (`ctx` knows which) take precedence.
    """
    from foresee_dsl.campaign.campaign_file import is_campaign, read_campaign
    from foresee_dsl.drivers.consent import refuse_programs
    from foresee_dsl.errors import ForeseeError

    values = dict(flags.settings)
    sources = {name: ctx.get_parameter_source(name) for name in (*values, "budget")}
    on_command_line = {name for name, source in sources.items() if source is not None and source.name == "COMMANDLINE"}
    drivers: tuple[str, ...] = (values["driver"],)
    rankers: tuple[str, ...] = (values["ranker"],)
    written_in = ""
    if any(is_campaign(path) for path in paths):
        if len(paths) > 1:
            raise ForeseeError("a campaign file names its own test cases, so no other path can be given beside it")
        file = read_campaign(Path(paths[0]), allow_outside=flags.allow_outside)
        (named_in,), paths = paths, list(file.paths)
        drivers = file.drivers if file.drivers and "driver" not in on_command_line else drivers
        for option, names, what in (
            ("driver", file.drivers, "another driver"),
            ("against", file.against or (), "other reference drivers"),
        ):
            if option not in on_command_line:
                refuse_programs(
                    ((address, Path(named_in)) for address in names),
                    f"--run-programs starts the programs that the file names, --{option} names {what} instead",
                    unless=flags.run_programs,
                )
        rankers = file.rankers if file.rankers and "ranker" not in on_command_line else rankers
        in_file = {option_name(name): value for name, value in file.settings.items()}
        values |= {name: value for name, value in in_file.items() if name not in on_command_line}
        if file.against is not None and "against" not in on_command_line:
            values["against"], written_in = file.against, named_in
        if "budget" not in on_command_line and file.budget_s is not None:
            budget = file.budget_s / 60
    else:
        for name in on_command_line & {"goal", "first_from"}:
            if not values[name]:  # with a campaign file, an empty name leaves out the file's
                raise typer.BadParameter(EMPTY, param_hint=_typed(name))
    settings = tuple(_settings(values, driver, ranker) for driver in drivers for ranker in rankers)
    return Request(paths, settings, budget, _without_references(values["against"], drivers, settings, written_in))


def _settings(values: Mapping[str, Any], driver: str, ranker: str) -> CampaignSettings:
    from foresee_dsl.derive.clipping.clip import DRIVES_S
    from foresee_dsl.derive.presets import preset as load_preset
    from foresee_dsl.drivers.registry import handover_of
    from foresee_dsl.forecast.protocol import Learned
    from foresee_dsl.forecast.registry import load_ranker

    longest_s = max(values["before"] - DRIVES_S, 0.0)
    if (values["handover"] or 0.0) > longest_s:
        message = (
            f"the handover must end {DRIVES_S:g} s before the risky point, so it can last at most {longest_s:g} s here"
        )
        raise typer.BadParameter(message, param_hint="--handover")
    drivers_handover_s = handover_of(_make_once(driver), longest_s)
    if isinstance(loaded_ranker := load_ranker(ranker), Learned):
        loaded_ranker.weights_hash(driver)  # raises if no weights were learned for this driver
    load_preset(values["preset"])
    against = _references(values["against"], driver)
    chosen = {f.name: values[option_name(f.name)] for f in fields(CampaignSettings) if option_name(f.name) in values}
    _refuse_other_words(CampaignSettings, chosen)
    if chosen["handover_s"] is None:
        chosen["handover_s"] = drivers_handover_s
    chosen["first_from"] = Path(chosen["first_from"]).as_posix() if chosen["first_from"] else ""
    return CampaignSettings(**{**chosen, "driver": driver, "ranker": ranker, "against": against})


def _refuse_other_words(settings: type, values: Mapping[str, Any]) -> None:
    """Raise `BadParameter` for the value of a setting that is not one of its words."""
    for name, kind in get_type_hints(settings).items():
        words = get_args(kind) if get_origin(kind) is Literal else ()
        if words and name in values and values[name] not in words:
            message = f"{values[name]!r} is not one of: {', '.join(words)}"
            raise typer.BadParameter(message, param_hint=_typed(option_name(name)))


def _typed(option: str) -> str:
    """Return an option as one types it: `--first-from`."""
    return f"--{option.replace('_', '-')}"


def _references(names: str | tuple[str, ...] | None, driver: str) -> tuple[str, ...]:
    from foresee_dsl.campaign.campaign_file import NOBODY
    from foresee_dsl.drivers.registry import find_driver, reference_drivers

    if names is None:
        return reference_drivers(driver)
    listed = common.names_in(names) if isinstance(names, str) else names
    if NOBODY in listed and len(listed) > 1:
        raise typer.BadParameter(
            f"`{NOBODY}` stands alone: remove it, or write only `{NOBODY}`", param_hint="--against"
        )
    references = tuple(dict.fromkeys(name for name in listed if name != NOBODY))
    for name in references:
        find_driver(name)
    return tuple(name for name in references if name != driver)


def _without_references(
    names: str | tuple[str, ...] | None, drivers: tuple[str, ...], settings: Sequence[CampaignSettings], written_in: str
) -> tuple[str, ...]:
    """Return a note on each of several drivers that has no reference driver, because only it is named as one; with one
    driver, this is an error.

    `written_in`: the campaign file that names the reference drivers; "" for the command line.
    """
    from foresee_dsl.campaign.campaign_file import NOBODY, own_reference
    from foresee_dsl.errors import ForeseeError

    listed = common.names_in(names) if isinstance(names, str) else names
    if not listed or listed == (NOBODY,):
        return ()
    alone = tuple(dict.fromkeys(each.driver for each in settings if not each.against))
    if alone and len(drivers) == 1:
        message = ": ".join(own_reference(alone[0]))
        if written_in:
            raise ForeseeError(f"{written_in}: `against`: {message}")
        raise typer.BadParameter(message, param_hint="--against")
    return tuple(f"{driver} has no reference driver: `against` names only {driver} itself" for driver in alone)


def _make_once(driver: str) -> Driver:
    """Return a driver, whose version becomes part of a campaign's keys; an error shows the place in the driver's
    code."""
    from foresee_dsl.drivers.process_state import put_back
    from foresee_dsl.drivers.registry import load_driver
    from foresee_dsl.errors import DriverError

    try:
        with put_back(0):
            return load_driver(driver)
    except DriverError as err:
        if err.__cause__ is None:
            raise
        from foresee_dsl.report.safe_text import safe
        from foresee_dsl.simulate.driver_faults import traceback_of

        lines = "\n".join(safe(line, 10_000) for line in traceback_of(err.__cause__).splitlines())
        raise DriverError(f"{safe(err, 10_000)}\n{lines}".rstrip()) from err


def shard_of(text: str) -> Shard:
    """Return the part of a campaign that `--shard` selects; for "", the whole campaign."""
    from foresee_dsl.campaign.settings import Shard

    try:
        return Shard.parse(text) if text else Shard()
    except ValueError as err:
        raise typer.BadParameter(str(err), param_hint="--shard") from err


def of_other_versions(store: Path, count: int) -> str:
    """Return the message about results that other versions of this tool computed."""
    results = f"{counted(count, 'result')} in {store} {'is' if count == 1 else 'are'}"
    return (
        f"{results} of another version of foresee-dsl and may differ: not used "
        f"(foresee store gc {store} --older deletes them)"
    )


def notes_on(store: Store) -> list[str]:
    """Return the notes on a store after a campaign: one sentence per kind of result that was not used."""
    others = store.of_other_versions()
    notes = [of_other_versions(store.folder, others)] if others else []
    return [*notes, damage] if (damage := _damage_in(store)) else notes


def _damage_in(store: Store) -> str:
    from foresee_dsl.report.safe_text import safe

    sentences = []
    if store.damaged:
        names = sorted(set(store.damaged.values()))
        listed = ", ".join(safe(name, 80) for name in names[:_SHOWN]) + (", ..." if len(names) > _SHOWN else "")
        sentences.append(f"{counted(len(store.damaged), 'result')} had been changed on the disk: {listed}")
    if store.rescued is not None:
        lost = f", at least {counted(store.lost, 'result')} could not" if store.lost else ""
        sentences.append(f"{counted(store.rescued, 'result')} could be read from its database{lost}; the old "
                    "database is kept as runs.damaged-*.sqlite")  # fmt: skip
    return (
        f"The store {store.folder} was damaged. {'; '.join(sentences)}. The campaign ran the missing results again."
        if sentences
        else ""
    )


_SHOWN = 5
"""Maximum number of names of damaged results in a note (ours)."""


def executor_of(name: str, scheduler: str, dashboard: str = "") -> Callable[[RunOptions], Executor]:
    """Return the factory of the executor that `--executor`, `--scheduler` and `--dashboard` select."""
    from foresee_dsl.campaign.workers.pool import local

    if name == "dask":
        from foresee_dsl.campaign.workers.cluster import dask

        return dask(scheduler, dashboard=dashboard)
    if name != "local":
        raise typer.BadParameter(f"{name!r} is not one of: local, dask", param_hint="--executor")
    for option, value in (("--scheduler", scheduler), ("--dashboard", dashboard)):
        if value:
            raise typer.BadParameter("this option needs --executor dask", param_hint=option)
    return local

"""The command `init`: writes a small project to start from, which passes `check` and whose first campaign finds a
failure."""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Iterable
from enum import StrEnum
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from foresee_dsl.cli.completion import drivers
from foresee_dsl.cli.options.common import console
from foresee_dsl.files import read_outside_text

if TYPE_CHECKING:
    from foresee_dsl.exchange.driver_kinds import DriverKind

_FILES = (
    ("networks/crossroads.foresee", "networks/crossroads.foresee"),
    ("scenarios/main_street.foresee", "scenarios/main_street.foresee"),
    ("campaign.foresee", "campaign.foresee"),
    ("regressions/.gitkeep", ""),
    (".gitattributes", "gitattributes"),
    (".gitignore", "gitignore"),
    ("README.md", "README.md"),
)
"""Each file of the project with its template in `templates/init`; "" stands for an empty file."""
_DRIVER_FILES = (("scenarios/first_drive.foresee", "scenarios/first_drive.foresee"), ("pytest.ini", "pytest.ini"))
"""The files that a project with a driver of its own has as well."""
_MAIN_STREET = "scenarios/main_street.foresee::steps_out"


class BuildServer(StrEnum):
    """Build server for which a configuration file is written."""

    github = "github"
    gitlab = "gitlab"


_CI_FILES = {BuildServer.github: ".github/workflows/scenarios.yml", BuildServer.gitlab: ".gitlab-ci.yml"}


def init(
    what: Annotated[
        str,
        typer.Argument(metavar="[DIR]", help="Folder of the project, which is created; by default this folder."),
    ] = ".",
    sketch: Annotated[
        str,
        typer.Argument(metavar="[SKETCH]", help="After `network`: a street sketch, or - for standard input."),
    ] = "",
    driver: Annotated[
        str,
        typer.Option(
            "--driver",
            help="The driver under test: one of `foresee drivers`, or a kind of driver that is written into the "
            "project, such as python or external-cpp (--kinds lists them).",
            autocompletion=drivers,
        ),
    ] = "pdm",
    kinds: Annotated[bool, typer.Option("--kinds", help="List the kinds of drivers, and write nothing.")] = False,
    ci: Annotated[
        BuildServer, typer.Option("--ci", help="Build server for which a configuration file is written.")
    ] = BuildServer.github,
    install: Annotated[
        str,
        typer.Option(
            "--install",
            metavar="REQUIREMENT",
            help="Requirement that the build server passes to pip; by default the origin of this installation.",
        ),
    ] = "",
    out: Annotated[
        Path | None,
        typer.Option("--out", help="File of a sketch's network; by default beside the sketch."),
    ] = None,
    scenario: Annotated[
        Path | None,
        typer.Option("--scenario", help="Also write a first scenario on the sketch's network, to this file."),
    ] = None,
) -> None:
    """Write a small project to start from: roads, a scenario with three cases, a campaign, files for git and CI.

    Nothing is overwritten: if one of the files exists already, no file is written.

    `foresee init network SKETCH` makes a network from lines such as `a 0 0`, `b 200 0 signals`, `a-b lanes 2 speed 50`.

    [dim]foresee init crossroads
    cd crossroads && foresee campaign campaign.foresee
    foresee init my_project --driver external-cpp[/dim]
    """  # fmt: skip
    if kinds:
        _list_kinds()
        return
    if what == "network":
        _network(sketch, out, scenario)
        return
    folder = Path(what)
    if sketch or out is not None or scenario is not None:
        raise typer.BadParameter("a sketch, --out and --scenario can only be used with `foresee init network SKETCH`")
    from foresee_dsl.exchange.sketch import plain_name
    from foresee_dsl.files import templates, write_whole

    kind = _kind_of(driver)
    address = driver if kind is None else kind.driver
    ci_file = _CI_FILES[ci]
    values = {
        "name": plain_name(folder.resolve().name) or "first",
        "driver": address if re.fullmatch(r"\w+", address) else f'"{address}"',
        "address": address,
        "quoted": shlex.quote(address),
        "kind": kind,
        "driver_files": [] if kind is None else list(kind.sources()),
        "build": () if kind is None else kind.build,
        "ignored": () if kind is None else kind.ignore,
        "consent": " --run-programs" if ":" in address else "",
        "takes": _CAMPAIGN_TAKES if kind is None else _CAMPAIGN_OF_PROGRAM_TAKES,
        "ci_file": ci_file,
        "install": install or _installed_from(),
    }
    listed = (*_FILES, *(_DRIVER_FILES if kind is not None else ()), (ci_file, f"ci/{ci}.yml"))
    texts = {
        folder / file: templates("init", markup=False).get_template(f"{template}.j2").render(values) if template else ""
        for file, template in listed
    }
    if kind is not None:
        texts |= {folder / file: text for file, text in kind.texts(values).items()}
    _refuse_existing(texts)
    for file, text in texts.items():
        write_whole(file, text)
        typer.echo(f"wrote {file}")
    typer.echo(_next_commands(folder, kind))


_CAMPAIGN_TAKES, _CAMPAIGN_OF_PROGRAM_TAKES = "ten seconds", "half a minute"
"""How long the first campaign takes on two idle cores, measured."""


def _kind_of(driver: str) -> DriverKind | None:
    """Return the kind of driver of this name; None for the address of a driver, which is checked before anything is
    written."""
    from foresee_dsl.drivers.registry import load_driver
    from foresee_dsl.errors import DriverError
    from foresee_dsl.exchange.driver_kinds import driver_kinds

    kinds = driver_kinds()
    if driver in kinds:
        return kinds[driver]
    try:
        load_driver(driver)
    except DriverError as err:
        raise DriverError(f"{err}; kinds of drivers that can be written: {', '.join(kinds)}") from err
    return None


def _list_kinds() -> None:
    from rich.markup import escape

    from foresee_dsl.exchange.driver_kinds import driver_kinds
    from foresee_dsl.report.terminal.tables import plain_table

    rows = ((escape(kind.name), escape(kind.about)) for kind in driver_kinds().values())
    console().print(plain_table(("kind", "what is written"), rows, align="<<"))


def _refuse_existing(files: Iterable[Path]) -> None:
    """Raise if one of the files exists."""
    from foresee_dsl.errors import ForeseeError

    if existing := [str(file) for file in files if file.exists()]:
        raise ForeseeError(
            f"nothing was written: {', '.join(existing)} {'is' if len(existing) == 1 else 'are'} there already"
        )


def _next_commands(folder: Path, kind: DriverKind | None) -> str:
    """Return the commands with which the user goes on, in lines."""
    git = "git init && git add . && git commit -m 'First scenarios'"
    if kind is None:
        commands = [
            (f"foresee run {_MAIN_STREET}", "one case: it passes"),
            ("foresee campaign campaign.foresee", f"{_CAMPAIGN_TAKES}: finds a failure close to it"),
        ]
    else:
        quoted = shlex.quote(kind.driver)
        missing = f"needs {', '.join(kind.missing)}, which you have to install" if kind.missing else ""
        commands = [
            *([(f"python -m pip install {kind.install}", "what the driver needs")] if kind.install else ()),
            *((command, missing) for command in kind.build),
            (f"foresee run scenarios/first_drive.foresee --driver {quoted}", "it passes"),
            ("pytest", "all cases, each a test"),
            (f"foresee conform {quoted}", "does it keep the rules?"),
            ("foresee campaign campaign.foresee --run-programs", f"{_CAMPAIGN_OF_PROGRAM_TAKES}: finds failures"),
        ]
    if folder != Path():
        commands.insert(0, (f"cd {shlex.quote(str(folder))}", ""))
    commands.append((git, ""))
    return "\nNext:\n" + "\n".join(f"  {command}{f'  # {why}' if why else ''}" for command, why in commands)


def _installed_from() -> str:
    """Return the pip requirement of this installation: the repository that it came from (PEP 610), otherwise a
    wheel."""
    try:
        url = json.loads(metadata.distribution("foresee-dsl").read_text("direct_url.json") or "{}")
    except (metadata.PackageNotFoundError, ValueError):
        url = {}
    if vcs := url.get("vcs_info"):
        return f"'foresee-dsl @ {vcs['vcs']}+{url['url']}@{vcs['commit_id']}'"
    return "wheels/foresee_dsl-*.whl  # put its wheel there, or name its repository: git+https://..."


def _network(sketch: str, out: Path | None, scenario: Path | None) -> None:
    """Write the network of a street sketch and a first scenario on it: both or neither, and nothing is overwritten."""
    import os
    import sys

    from foresee_dsl.errors import ForeseeError
    from foresee_dsl.exchange.sketch import checked_text, network_of_sketch, plain_name, starter_of
    from foresee_dsl.files import write_whole
    from foresee_dsl.language.printer import print_model

    if not sketch:
        raise typer.BadParameter(
            "name a sketch: `foresee init network streets.txt`, or `-` for standard input "
            "(a project in a folder of this name: `foresee init ./network`)"
        )
    if sketch == "-":
        text, source = sys.stdin.read(), "standard input"
        file = out or Path("network.foresee")
    else:
        source = sketch
        try:
            text = read_outside_text(Path(sketch))
        except (OSError, UnicodeDecodeError) as err:
            raise ForeseeError(f"the sketch {sketch} cannot be read: {err}") from err
        file = out or Path(sketch).with_suffix(".foresee")
    _refuse_existing([file] if scenario is None else [file, scenario])
    network = network_of_sketch(text, plain_name(file.resolve().stem) or "streets", source)
    texts = {file: checked_text(network, source)}
    if scenario is not None:
        used = os.path.relpath(file, scenario.parent).replace(os.sep, "/")
        name = plain_name(scenario.resolve().stem) or "streets"
        texts[scenario] = print_model(starter_of(network, name, used))
    for target, written in texts.items():
        write_whole(target, written)
        typer.echo(f"wrote {target}")
    if scenario is not None:
        typer.echo(f"\nNext:\n  foresee run {scenario}")

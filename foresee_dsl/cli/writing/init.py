"""The command `init`: writes a small project to start from, which passes `check` and whose first campaign finds a
failure."""

from __future__ import annotations

import json
import re
from enum import StrEnum
from importlib import metadata
from pathlib import Path
from typing import Annotated

import typer

from foresee_dsl.cli.options.common import DriverOption
from foresee_dsl.files import read_outside_text

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
    driver: DriverOption = "pdm",
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

    [dim]foresee init crossroads
    cd crossroads && foresee campaign campaign.foresee[/dim]

    `foresee init network SKETCH` makes a network from lines such as `a 0 0`, `b 200 0 signals`, `a-b lanes 2 speed 50`.
    """  # fmt: skip
    if what == "network":
        _network(sketch, out, scenario)
        return
    folder = Path(what)
    if sketch or out is not None or scenario is not None:
        raise typer.BadParameter("a sketch, --out and --scenario can only be used with `foresee init network SKETCH`")
    from foresee_dsl.drivers.registry import load_driver
    from foresee_dsl.errors import ForeseeError
    from foresee_dsl.files import templates, write_whole

    load_driver(driver)  # an unknown name is reported before anything is written
    ci_file = _CI_FILES[ci]
    files = [(folder / name, template) for name, template in (*_FILES, (ci_file, f"ci/{ci}.yml"))]
    if existing := [str(file) for file, _ in files if file.exists()]:
        raise ForeseeError(
            f"nothing was written: {', '.join(existing)} {'is' if len(existing) == 1 else 'are'} there already"
        )
    name = re.sub(r"\W+", "_", folder.resolve().name.lower(), flags=re.ASCII).strip("_")
    values = {
        "name": name if re.match(r"[a-z]", name) else "first",
        "driver": driver if re.fullmatch(r"\w+", driver) else f'"{driver}"',
        "ci_file": ci_file,
        "install": install or _installed_from(),
    }
    texts = [(file, templates("init", markup=False).get_template(f"{template}.j2").render(values) if template else "")
             for file, template in files]  # fmt: skip
    for file, text in texts:
        write_whole(file, text)
        typer.echo(f"wrote {file}")
    here = "" if folder == Path() else f"  cd {folder}\n"
    typer.echo(
        f"\nNext:\n{here}"
        "  foresee run scenarios/main_street.foresee::steps_out   # one case: it passes\n"
        "  foresee campaign campaign.foresee                      # a minute: finds a failure close to it\n"
        "  git init && git add . && git commit -m 'First scenarios'"
    )


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
    from foresee_dsl.exchange.sketch import checked_text, network_of_sketch, starter_of
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
    targets = [file] if scenario is None else [file, scenario]
    if existing := [str(target) for target in targets if target.exists()]:
        raise ForeseeError(
            f"nothing was written: {', '.join(existing)} {'is' if len(existing) == 1 else 'are'} there already"
        )
    network = network_of_sketch(text, _name(file), source)
    texts = {file: checked_text(network, source)}
    if scenario is not None:
        used = os.path.relpath(file, scenario.parent).replace(os.sep, "/")
        texts[scenario] = print_model(starter_of(network, _name(scenario), used))
    for target, written in texts.items():
        write_whole(target, written)
        typer.echo(f"wrote {target}")
    if scenario is not None:
        typer.echo(f"\nNext:\n  foresee run {scenario}")


def _name(file: Path) -> str:
    name = re.sub(r"\W+", "_", file.resolve().stem.lower(), flags=re.ASCII).strip("_")
    return name if re.match(r"[a-z]", name) else "streets"

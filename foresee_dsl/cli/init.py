"""The command init: a small project to begin with, which passes `check` and finds a failure in its first campaign."""

from __future__ import annotations

import json
import re
from enum import StrEnum
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from foresee_dsl.cli.options.common import DriverOption

if TYPE_CHECKING:
    pass

_FILES = (
    ("networks/crossroads.foresee", "networks/crossroads.foresee"),
    ("scenarios/main_street.foresee", "scenarios/main_street.foresee"),
    ("campaign.foresee", "campaign.foresee"),
    ("regressions/.gitkeep", ""),
    (".gitattributes", "gitattributes"),
    (".gitignore", "gitignore"),
    ("README.md", "README.md"),
)
"""Each file with its template in `templates/init`; "": an empty file."""


class Server(StrEnum):
    """Whose file for a build server is written."""

    github = "github"
    gitlab = "gitlab"


_CI_FILES = {Server.github: ".github/workflows/scenarios.yml", Server.gitlab: ".gitlab-ci.yml"}


def init(
    folder: Annotated[Path, typer.Argument(metavar="[DIR]", help="Where to; it is made. By default here.")] = Path(),
    driver: DriverOption = "pdm",
    ci: Annotated[Server, typer.Option("--ci", help="For which build server a file is written.")] = Server.github,
    install: Annotated[
        str,
        typer.Option(
            "--install",
            metavar="REQUIREMENT",
            help="What the build server gives to pip; by default from where this foresee was installed.",
        ),
    ] = "",
) -> None:
    """Write a small project to begin with: roads, a scenario with three cases, a campaign, files for git and CI.

    Nothing is overwritten: where one of its files is there already, nothing at all is written.

    [dim]foresee init crossroads
    cd crossroads && foresee campaign campaign.foresee[/dim]
    """  # fmt: skip
    from foresee_dsl.drivers.registry import load_driver
    from foresee_dsl.errors import ForeseeError
    from foresee_dsl.files import templates, write_whole

    load_driver(driver)  # an unknown name is reported before anything is written
    ci_file = _CI_FILES[ci]
    files = [(folder / name, template) for name, template in (*_FILES, (ci_file, f"ci/{ci}.yml"))]
    if there := [str(file) for file, _ in files if file.exists()]:
        raise ForeseeError(
            f"nothing was written: {', '.join(there)} {'is' if len(there) == 1 else 'are'} there already"
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
        "  foresee campaign campaign.foresee                      # a minute: finds where it nearly does not\n"
        "  git init && git add . && git commit -m 'First scenarios'"
    )


def _installed_from() -> str:
    """Return what pip installs this tool from: the repository that it came from (PEP 610), or else a wheel."""
    try:
        url = json.loads(metadata.distribution("foresee-dsl").read_text("direct_url.json") or "{}")
    except (metadata.PackageNotFoundError, ValueError):
        url = {}
    if vcs := url.get("vcs_info"):
        return f"'foresee-dsl @ {vcs['vcs']}+{url['url']}@{vcs['commit_id']}'"
    return "wheels/foresee_dsl-*.whl  # put its wheel there, or name its repository: git+https://..."

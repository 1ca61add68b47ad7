"""Commands about the installation: `drivers`, `models`, `lsp` (the language server) and `doctor`."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Annotated

import typer

from foresee_dsl.cli.options.common import FAILED, JsonOption, console, print_json
from foresee_dsl.errors import ForeseeError


def drivers(json: JsonOption = False) -> None:
    """List the drivers that can be put under test."""
    from foresee_dsl.drivers.registry import describe_drivers

    descriptions = describe_drivers()
    if json:
        print_json({"drivers": descriptions})
        return
    from rich.markup import escape

    from foresee_dsl.report.terminal.tables import plain_table

    rows = (tuple(map(escape, (d.name, d.version, d.package, d.doc))) for d in descriptions)
    console().print(plain_table(("driver", "version", "package", "about"), rows, align="<<<<"))


def models(
    catalogue: Annotated[
        Path | None, typer.Argument(metavar="FILE", help="File of the catalogue; by default the bundled catalogue.")
    ] = None,
    json: JsonOption = False,
) -> None:
    """List the models of vehicles, people and things that scenarios can name."""
    from foresee_dsl.compile.catalogue import spec_of
    from foresee_dsl.language.project.loading import load_catalogue

    specs = [spec_of(model) for model in load_catalogue(catalogue).values()]
    if json:
        print_json({"models": specs})
        return
    from rich.table import Table

    table = Table(box=None, pad_edge=False)
    table.add_column("model", no_wrap=True)
    for heading in ("length", "width", "height", "top", "speeds up", "brakes", "hardest"):
        table.add_column(heading, justify="right", no_wrap=True)
    for s in specs:
        sizes = (f"{size_m:.2f}" for size_m in (s.length_m, s.width_m, s.height_m))
        rates = (f"{rate_mps2:.1f}" for rate_mps2 in (s.acceleration_mps2, s.braking_mps2, s.emergency_braking_mps2))
        table.add_row(s.name, *sizes, f"{s.max_speed_mps * 3.6:.0f}", *rates)
    console().print(table)
    console().print("Sizes are in m, top speeds in km/h, accelerations and decelerations in m/s².", highlight=False)


# ---- lsp ------------------------------------------------------------------------------------------------------------

_LOCAL = "127.0.0.1"
"""Address on which the server listens. It reads any file that a client names, so only this machine may connect."""


def lsp(
    tcp: Annotated[
        int | None,
        typer.Option("--tcp", min=1, max=65535, help="Listen on this port of this machine, not on standard input."),
    ] = None,
) -> None:
    """Start the language server for editors, which talk to it over standard input and output.

    [dim]foresee lsp
    foresee lsp --tcp 9257[/dim]
    """
    from foresee_dsl.editor.server import serve_port, serve_streams

    if tcp is not None:
        message = f"foresee lsp listens on {_LOCAL}:{tcp}"
        raise typer.Exit(serve_port(_LOCAL, tcp, lambda: typer.echo(message, err=True)))
    # Standard output carries only the protocol, so other prints go to standard error.
    protocol = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    raise typer.Exit(serve_streams(sys.stdin.buffer, protocol))


# ---- doctor ---------------------------------------------------------------------------------------------------------

_PACKAGES = (
    *("lark", "pydantic", "libsumo", "eclipse-sumo", "numpy", "networkx", "jinja2", "rich"),
    *("typer", "shapely", "defusedxml"),
)


@dataclass(frozen=True)
class InstallationCheck:
    """Result of one check of the installation; the last field says what to do, and is empty if the check passed."""

    what: str
    ok: bool
    detail: str
    mend: str = ""


def doctor(json: JsonOption = False) -> None:
    """Check the installation: what is installed, what works, and how to repair the rest."""
    findings = [_python(), *map(_package, _PACKAGES), *map(_attempt, _CHECKS)]
    if json:
        print_json({"ok": all(f.ok for f in findings), "findings": findings})
    else:
        from rich.markup import escape

        screen = console()
        for f in findings:
            mark = "[green]ok  [/green]" if f.ok else "[red]FAIL[/red]"
            screen.print(f"{mark} {escape(f.what)}: {escape(f.detail)}")
            if f.mend:
                screen.print(f"     [yellow]{escape(f.mend)}[/yellow]")
    if not all(f.ok for f in findings):
        raise typer.Exit(FAILED)


def _python() -> InstallationCheck:
    version = ".".join(map(str, sys.version_info[:3]))
    ok = sys.version_info >= (3, 11)
    return InstallationCheck("Python", ok, version, "" if ok else "install Python 3.11 or newer")


def _package(name: str) -> InstallationCheck:
    try:
        return InstallationCheck(name, True, metadata.version(name))
    except metadata.PackageNotFoundError:
        return InstallationCheck(name, False, "not installed", "run: pip install foresee-dsl")


def _attempt(check: tuple[str, Callable[[], str], str]) -> InstallationCheck:
    what, function, advice = check
    try:
        return InstallationCheck(what, True, function())
    except Exception as err:  # any failure is a result of the check
        return InstallationCheck(what, False, f"{type(err).__name__}: {err}", advice)


def _netconvert() -> str:
    from foresee_dsl.compile.nets.netconvert import tool_version

    return tool_version()


def _versions_agree() -> str:
    versions = metadata.version("libsumo"), metadata.version("eclipse-sumo")
    if versions[0] != versions[1]:
        raise RuntimeError(f"libsumo {versions[0]}, eclipse-sumo {versions[1]}")
    return f"both {versions[0]}"


def _libsumo() -> str:
    # In a separate process, because a broken library may kill it.
    code = "import libsumo; print(libsumo.simulation.getVersion()[1])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)  # noqa: S603 - our own interpreter
    if done.returncode:
        raise RuntimeError((done.stderr.strip().splitlines() or ["the process ended without a message"])[-1])
    return done.stdout.strip()


def _grammar() -> str:
    from foresee_dsl.files import data_folder
    from foresee_dsl.language.parser import parse

    file = data_folder("scenarios") / "models.foresee"
    parse(file.read_text(encoding="utf-8"), str(file))
    return "reads the bundled catalogue"


def _cache() -> str:
    from foresee_dsl.files import cache_folder

    folder = cache_folder("doctor")
    probe = folder / "probe"
    probe.write_text("x", encoding="utf-8")
    probe.unlink()
    return str(folder.parent)


def _drivers() -> str:
    from foresee_dsl.drivers.registry import describe_drivers
    from foresee_dsl.errors import DriverError

    descriptions = describe_drivers()
    for broken in (d for d in descriptions if not d.version and not d.unavailable):
        raise DriverError(broken.doc)
    return "; ".join(
        [", ".join(d.name for d in descriptions if d.version), *(d.doc for d in descriptions if d.unavailable)]
    )


def _commands() -> str:
    """Return the commands of other packages, each with its package; raise for one that cannot be used."""
    from foresee_dsl.cli import COMMANDS
    from foresee_dsl.cli.added import ADDED, CommandError, clashes, load_command
    from foresee_dsl.plugins import package_of

    ours = frozenset(name for _, name, _ in COMMANDS)
    for sentence in clashes(ours):
        raise CommandError(sentence)
    for name in ADDED.names():
        load_command(name)
    return ", ".join(f"{entry.name} ({package_of(entry)})" for entry in ADDED.entries()) or "none"


def _report_formats() -> str:
    """Return the report formats of other packages, each with its package; raise for one that cannot be imported."""
    from foresee_dsl.plugins import package_of
    from foresee_dsl.report.formats import REPORT_FORMATS

    for name in REPORT_FORMATS.names():
        REPORT_FORMATS.load(name)
    return ", ".join(f"{entry.name} ({package_of(entry)})" for entry in REPORT_FORMATS.entries()) or "none"


def _other_plug_ins() -> str:
    """Return what other packages offer in groups without a check of their own; raise for what cannot be imported."""
    from foresee_dsl.plugins import PluginGroup, package_of

    offered = []
    for group in sorted(metadata.entry_points().groups):
        if not group.startswith("foresee_dsl.") or group in _CHECKED:
            continue
        kind = group.removeprefix("foresee_dsl.").replace("_", " ")
        plug_ins = PluginGroup(group, kind.removesuffix("s"), ForeseeError)
        for name in plug_ins.names():
            plug_ins.load(name)
        names = [entry.name for entry in plug_ins.entries() if package_of(entry) != "foresee-dsl"]
        offered += [f"{kind}: {', '.join(names)}"] if names else []
    return "; ".join(offered) or "none"


def _whole_line() -> str:
    from foresee_dsl.campaign.driving import run_test_case
    from foresee_dsl.files import data_folder
    from foresee_dsl.language.project.loading import load_test_cases

    case = load_test_cases([str(data_folder("scenarios"))])[0]
    result = run_test_case(case, "pdm", 0)
    return f"{case.scenario.name}: {result.verdict.value} after {result.duration_s:.1f} s"


_REINSTALL = "run: pip install --force-reinstall 'eclipse-sumo==1.28.*' 'libsumo==1.28.*'"


def _plug_ins() -> str:
    """Return the plug-in distributions that the extras name, with their versions or how to install them."""
    from foresee_dsl.plugins import not_installed

    distributions = []
    for line in metadata.requires("foresee-dsl") or ():
        name, extra = line.partition(";")[0].partition("[")[0].strip(), line.partition("extra == ")[2].strip(" '\"")
        if extra and name == f"foresee-{extra}":
            try:
                distributions.append(f"{name} {metadata.version(name)}")
            except metadata.PackageNotFoundError:
                distributions.append(f"{name} is {not_installed(extra)}")
    return "; ".join(sorted(distributions))


_CHECKED = ("foresee_dsl.drivers", "foresee_dsl.commands", "foresee_dsl.report_formats")
"""Groups of plug-ins that have a check of their own."""
_CHECKS: tuple[tuple[str, Callable[[], str], str], ...] = (
    ("libsumo and netconvert agree", _versions_agree, _REINSTALL),
    ("netconvert runs", _netconvert, _REINSTALL),
    ("libsumo loads", _libsumo, _REINSTALL + " (on Debian: apt-get install libgomp1 if a library is missing)"),
    ("grammar and catalogue", _grammar, "reinstall foresee-dsl: its data files are missing"),
    ("cache folder", _cache, "set FORESEE_CACHE to a folder that you may write to"),
    ("plug-ins", _plug_ins, "reinstall foresee-dsl"),
    ("drivers", _drivers, "uninstall or repair the package in the message"),
    ("commands of plug-ins", _commands, "uninstall or repair the package in the message"),
    ("report formats of plug-ins", _report_formats, "uninstall or repair the package in the message"),
    ("other plug-ins", _other_plug_ins, "uninstall or repair the package in the message"),
    ("a bundled scenario runs", _whole_line, "run it by `foresee run` with FORESEE_DEBUG=1 and report the output"),
)

"""Commands that compare by meaning: `diff`, the hooks for git (`textconv`, `git-diff`), and `repin` after a parent's
edit."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from foresee_dsl.cli.options.common import FAILED, AllowOutsideOption, JsonOption, json_document, print_json
from foresee_dsl.cli.options.output import ComparisonFormatOption, report_results
from foresee_dsl.errors import InputError
from foresee_dsl.report.formats import CommandReport

if TYPE_CHECKING:
    from collections.abc import Sequence

    from foresee_dsl.errors import Diagnostic
    from foresee_dsl.language.document import TestCase


def diff(
    old: Annotated[
        str, typer.Argument(metavar="OLD", help="The old file, or FILE::CASE; without NEW, a clip or a mutant.")
    ],
    new: Annotated[
        str,
        typer.Argument(metavar="NEW", help="The new file, or FILE::CASE; without it, OLD is compared with its parent."),
    ] = "",
    format: ComparisonFormatOption = "text",
    exit_code: Annotated[
        bool, typer.Option("--exit-code", help="Exit with 1 if they differ, as git diff does.")
    ] = False,
    allow_outside: AllowOutsideOption = False,
) -> None:
    """Show how two files differ in meaning, grouped by subject; layout, order and units do not count.

    [dim]foresee diff a.foresee b.foresee
    foresee diff a.foresee::r01 a.foresee::r02
    foresee diff out/children/scenario7/red_light_runner_r02_p1_m3.foresee[/dim]
    """
    from foresee_dsl.language.diff.addresses import compare_addresses, parent_address
    from foresee_dsl.language.diff.rendering import render_groups, render_markdown

    first, second = (old, new) if new else (parent_address(old), old)
    differences = compare_addresses(first, second, allow_outside=allow_outside)

    def markdown() -> str:
        return render_markdown(differences.changes, differences.texts, old=differences.old, new=differences.new)

    report_results(
        format,
        CommandReport("diff", lambda: json_document(differences), forms={"markdown": markdown}),
        people=lambda _: typer.echo(render_groups(differences.changes, differences.texts, colour=_colour()), nl=False),
    )
    if exit_code and differences.changes:
        raise typer.Exit(FAILED)


def textconv(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A .foresee file.")],
    people: Annotated[
        bool, typer.Option("--people", help="Keep the statements for people: doc, tags, risk, fidelity, origin.")
    ] = False,
) -> None:
    """Print a file so that equal meaning is equal text, for `git diff`; a file with errors is printed unchanged.

    [dim]git config diff.foresee.textconv "foresee textconv"[/dim]
    """
    import shutil

    from foresee_dsl.files import open_outside
    from foresee_dsl.language.diff.plain import plain_text
    from foresee_dsl.language.parser import load

    try:
        content = plain_text(load(file).model, people=people).encode()
    except InputError:  # half-written, or conflict markers: git shows the text as it stands
        with open_outside(file) as opened:
            shutil.copyfileobj(opened, sys.stdout.buffer)
    else:
        sys.stdout.buffer.write(content)
    sys.stdout.buffer.flush()


def git_diff(
    arguments: Annotated[list[str], typer.Argument(metavar="PATH OLD_FILE OLD_HEX OLD_MODE NEW_FILE NEW_HEX NEW_MODE")],
) -> None:
    """Show one changed file in words; git calls this command itself.

    [dim]git config diff.foresee.command "foresee git-diff"[/dim]
    """
    path = arguments[0]
    if len(arguments) < _GIT_ARGUMENTS:
        typer.echo(f"* Unmerged path {path}")
        return
    new_path = arguments[_GIT_ARGUMENTS] if len(arguments) > _GIT_ARGUMENTS else path
    typer.echo(_git_diff(path, new_path, Path(arguments[1]), Path(arguments[4])), nl=False)


_GIT_ARGUMENTS = 7
"""Number of arguments that git passes: a path, then a file, hash and mode of each side; for an unmerged path only the
path (git(1)). For a renamed or copied file its new path and a text about the renaming follow."""


def _git_diff(path: str, new_path: str, old: Path, new: Path) -> str:
    """Return the differences of one file below the command that prints them, which names both paths of a renamed
    file."""
    from foresee_dsl.language.diff.compare import diff_models
    from foresee_dsl.language.diff.plain import texts
    from foresee_dsl.language.diff.rendering import render_groups
    from foresee_dsl.language.parser import load

    try:
        a, b = load(old, shown_as=path).model, load(new, shown_as=new_path).model
        changes, texts_only = diff_models(a, b), texts(a, b)
    except InputError:  # added, removed, of another kind, or with errors: compare as text
        return _text_diff(path, new_path, old, new)
    return f"{_command(path, new_path)}\n\n{render_groups(changes, texts_only, colour=_colour())}\n"


def _command(path: str, new_path: str) -> str:
    import shlex

    return shlex.join(("foresee", "diff", path, *((new_path,) if new_path != path else ())))


def _text_diff(path: str, new_path: str, old: Path, new: Path) -> str:
    import difflib

    from foresee_dsl.files import read_outside

    sides = []
    for file in (old, new):
        try:
            text = read_outside(file, "difference").decode("utf-8", "replace") if file.is_file() else ""
        except OSError as err:
            return f"{_command(path, new_path)}\n* not compared: {err.strerror or err}\n"
        sides.append(text.splitlines())
    before, after = sides
    names = (f"a/{path}" if old.is_file() else "/dev/null", f"b/{new_path}" if new.is_file() else "/dev/null")
    lines = [_command(path, new_path), *difflib.unified_diff(before, after, *names, lineterm="")]
    return "\n".join(lines) + "\n"


def _colour() -> bool:
    """Return whether colours are visible: on our own terminal, or in git's pager."""
    return (sys.stdout.isatty() or "GIT_PAGER_IN_USE" in os.environ) and "NO_COLOR" not in os.environ


# ---- repin ----------------------------------------------------------------------------------------------------------


def repin(
    paths: Annotated[list[Path], typer.Argument(metavar="FILE", help="Clips and mutants, or folders of them.")],
    write: Annotated[
        bool,
        typer.Option(
            "--write/--dry-run", help="Write the new pins; by default the command only shows what it would write."
        ),
    ] = False,
    run: Annotated[
        bool,
        typer.Option(
            "--run", help="Run every stale file with the old parent and with the new one, and compare the verdicts."
        ),
    ] = False,
    json: JsonOption = False,
) -> None:
    """Show how a parent's edit affects its stale clips and mutants, and write their new pins.

    A file that no longer fits its parent is a conflict: it is reported and not changed, and the exit code is 1.

    [dim]foresee repin out/children
    foresee repin regressions --write
    foresee repin clip.foresee --run[/dim]
    """
    from foresee_dsl.language.repinning.repin import PinState, describe, plan, summary
    from foresee_dsl.language.repinning.repin import write as write_pins

    derived_files = plan(paths, _placement)
    verdicts: dict[Path, tuple[str, str]] = {}
    if run:
        from foresee_dsl.campaign.regression.before_and_after import before_and_after

        verdicts = before_and_after([derived for derived in derived_files if derived.state is PinState.STALE])
    written = write_pins(derived_files) if write else ()
    failed = [derived for derived in derived_files if derived.state in (PinState.CONFLICT, PinState.BLOCKED)]
    if json:
        from foresee_dsl.documents import plain

        listed = [plain(derived) | {"verdict": verdicts.get(derived.file)} for derived in derived_files]
        print_json({"ok": not failed, "written": written, "children": listed})
    else:
        for derived in derived_files:
            typer.echo(describe(derived, verdicts.get(derived.file), written=write), nl=False)
        typer.echo(summary(derived_files, written=write))
    if failed:
        raise typer.Exit(FAILED)


def _placement(case: TestCase) -> Sequence[Diagnostic]:
    """Return the errors of one case that appear when its network is built and every actor is placed."""
    from foresee_dsl.compile import placement_mistakes

    return placement_mistakes([case])

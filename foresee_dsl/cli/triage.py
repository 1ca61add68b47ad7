"""Commands that remember what people decided about findings, and list a folder's earlier campaigns."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from foresee_dsl.cli.findings import CampaignOption, written_campaign
from foresee_dsl.cli.options.common import JsonOption, console, print_json


class Word(StrEnum):
    """A decision on the command line: a kind of triage, or `open` to take it back."""

    KNOWN = "known"
    NOT_OURS = "not-ours"
    ACCEPTED = "accepted"
    OPEN = "open"


def triage(
    finding: Annotated[
        str | None, typer.Argument(metavar="FINDING", help="A finding's number or name; without it, list all entries.")
    ] = None,
    word: Annotated[
        Word | None,
        typer.Argument(
            metavar="[known|not-ours|accepted|open]",
            help="known: it is being worked on; not-ours: another part is at fault; accepted: it stays; open: no "
            "decision.",
        ),
    ] = None,
    note: Annotated[
        str, typer.Option("--note", metavar="TEXT", help="The reason, in words; every decision but open needs it.")
    ] = "",
    campaign: CampaignOption = Path("out"),
    json: JsonOption = False,
) -> None:
    """Write what was decided about a finding into triage.toml, the reviewed file of the project.

    Later campaigns of the project with this driver recognise the finding by its story; reports only count it.

    [dim]foresee triage 3 known --note "brakes late behind buses, issue 12"
    foresee triage 3 open
    foresee triage[/dim]
    """
    from foresee_dsl.campaign.findings.named_failure import find_failure
    from foresee_dsl.campaign.triage.decisions import Decision, Triage, decide, read_decisions, story_key
    from foresee_dsl.campaign.triage.standing import standing_of_written
    from foresee_dsl.errors import ForeseeError

    written = written_campaign(campaign)
    standing = standing_of_written(written)
    if finding is None:
        entries = tuple(read_decisions(standing.file).values())
        if json:
            print_json({"file": standing.file, "entries": entries, "standing": standing})
            return
        screen, own = console(), {decision.story for decision in standing.decisions.values()}
        for entry in entries:
            other = "" if entry.story in own else f"\n    not a finding of the campaign in {campaign}"
            screen.print(f"{entry.story}\n    {entry.text}{other}", soft_wrap=True, markup=False)
        for sentence in standing.notes:
            screen.print(sentence, soft_wrap=True, markup=False, style="dim")
        if not entries:
            screen.print(f"no entries in {standing.file}", soft_wrap=True, markup=False)
        return
    if word is None:
        raise typer.BadParameter("say what it is: known, not-ours, accepted, or open", param_hint="WORD")
    note = " ".join(note.split())
    if (word is Word.OPEN) == bool(note):
        what = "`open` removes the entry, and takes no note" if note else 'say why: --note "issue 12"'
        raise typer.BadParameter(what, param_hint="--note")
    wanted = find_failure(finding, campaign, tests=True, written=written).finding
    if wanted is None:
        raise ForeseeError(f"{finding} does not belong to a finding of the campaign in {campaign}")
    written.require(wanted, "story", "title")
    _check_here(wanted.test_case, standing.file, campaign)
    story = story_key(written.driver, wanted.story)
    if word is Word.OPEN and story not in read_decisions(standing.file):
        raise ForeseeError(f"{standing.file} has no entry for {story!r}")
    decision = None if word is Word.OPEN else Decision(story, Triage(word.value), note)
    decide(standing.file, story, decision)
    entries = (decision,) if decision is not None else ()
    if json:
        print_json({"file": standing.file, "entries": entries, "standing": standing_of_written(written)})
    else:
        text = decision.text if decision is not None else "open again"
        console().print(f"{wanted.title}: {text}\nwrote {standing.file}", soft_wrap=True, markup=False)


def _check_here(test_case: str, file: Path, campaign: Path) -> None:
    """Raise if a finding's test case is not below this folder or its project, because its triage file would then be
    that of another project.
    """
    from foresee_dsl.errors import ForeseeError
    from foresee_dsl.files import absolute
    from foresee_dsl.language.project.addresses import is_file, is_inside, project_folder

    source = test_case.partition("::")[0]
    if not is_file(Path(source)):
        raise ForeseeError(f"there is no {source} here: call `foresee triage` where the campaign was called")
    if not is_inside(file, [project_folder(absolute(place)) for place in (Path(), campaign)]):
        raise ForeseeError(f"{source} belongs to another project: call `foresee triage` in {file.parent}")


def history(
    folder: Annotated[Path, typer.Argument(metavar="OUT", help="A campaign's folder.")] = Path("out"),
    html: Annotated[
        Path | None, typer.Option("--html", metavar="FILE", help="Also write a page with the same table.")
    ] = None,
    json: JsonOption = False,
) -> None:
    """List the campaigns that ended in a folder: their findings by judgement, and what was new and gone in each.

    [dim]foresee history
    foresee history out --html out/history.html[/dim]
    """
    from foresee_dsl.campaign.triage.history import changes_of
    from foresee_dsl.campaign.written import JSON, read_campaign_file
    from foresee_dsl.errors import ForeseeError
    from foresee_dsl.report.history import history_table

    changes = changes_of(folder)
    if not changes:
        written = map(read_campaign_file, (folder / JSON, *folder.glob(f"*/{JSON}")))
        if any(campaign is not None and campaign.interrupted for campaign in written):
            raise ForeseeError(
                f"the campaign in {folder} was interrupted, and only campaigns that have ended are listed: the same "
                "command continues it"
            )
        raise ForeseeError(f"there is no campaign in {folder}: `foresee campaign PATH --out {folder}` runs one")
    if html is not None:
        from foresee_dsl.report.history import write_history

        write_history(folder, changes, html)
    if json:
        print_json({"campaigns": changes})
        return
    from foresee_dsl.report.terminal.tables import plain_table

    table = history_table(changes)
    align = "<" * table.texts + ">" * (len(table.headings) - table.texts)
    console().print(plain_table(table.headings, table.rows, align=align))
    if html is not None:
        typer.echo(str(html))

"""A report as text: Markdown for a pull request, with a section for each finding and pictures of the runs in a folder
beside it; and lines for a terminal."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from foresee_dsl.avoidance.judge import ANTICIPATING, R157
from foresee_dsl.files import templates, write_whole
from foresee_dsl.report.page.contents import Contents, contents_of
from foresee_dsl.report.page.entries import FindingEntry
from foresee_dsl.report.page.runs import Reader
from foresee_dsl.report.safe_text import safe

if TYPE_CHECKING:
    from jinja2 import Environment

LONGEST_BYTES = 60_000
"""Maximum size of the report, bytes. GitHub allows 65,536 characters in a comment; the remainder is for text that
people add. Ours."""
_LONGEST_TEXT, _LONGEST_CODE = 300, 1500
_SPECIAL = re.compile(r"[\\`*_{}\[\]<>&#|~!$^]")
_LINKS = re.compile(r"(?<=:)(?=//)|(?<=[wW]{3})(?=\.)|(?<=@)|(?<=&#35;)")
"""Places in a text at which code hosts would begin a link to an address, a person or an issue."""
_APART = "<!-- -->"
"""Invisible comment that is inserted at these places, so that no link begins."""


class MarkdownText(str):
    """A text that is already Markdown and must not be escaped."""

    __slots__ = ()


def write_markdown(folders: Sequence[Path], file: Path) -> Contents:
    """Write the report of finished campaigns, and beside it a folder with a picture of each finding's run.

    Raises:
        ForeseeError: a folder does not hold a campaign.
        OSError: a file cannot be written.
    """
    reader = Reader(plays=False)
    contents = contents_of(folders, reader)
    pictures = file.with_name(f"{file.stem}_files")
    strips: list[str] = []
    for finding in contents.findings:
        svg = reader.strip(finding.runs[0].outcome)
        name = f"{finding.anchor}.svg"
        strips.append(f"{quote(pictures.name)}/{quote(name)}" if svg else "")
        if svg:
            write_whole(pictures / name, svg)
    write_whole(file, as_markdown(contents, strips))
    return contents


def as_markdown(contents: Contents, strips: Sequence[str]) -> str:
    """Return the report in fewer than `LONGEST_BYTES`; findings that do not fit are only named at the end.

    Args:
        contents: the contents of the report. strips: for each finding the address of its picture, or "".
    """
    pairs = zip(contents.findings, (MarkdownText(strip) for strip in strips), strict=True)
    sections = [(finding, strip) for finding, strip in pairs if not finding.folded]
    low, high = 0, len(sections)
    while low < high:  # a binary search for the largest number of sections that fit
        middle = (low + high + 1) // 2
        if len(_rendered(contents, sections, middle).encode()) < LONGEST_BYTES:
            low = middle
        else:
            high = middle - 1
    return _rendered(contents, sections, low)


def _rendered(contents: Contents, sections: Sequence[tuple[FindingEntry, MarkdownText]], count: int) -> str:
    text = _templates().get_template("report.md.j2").render(
        contents=contents, sections=sections[:count], left=[finding for finding, _ in sections[count:]], code=code,
        block=block, mark=MarkdownText, code_free=escaped, commands=lambda run: "\n".join(run.command_lines),
    )  # fmt: skip
    return re.sub(r"\n{3,}", "\n\n", text)


@cache
def _templates() -> Environment:
    """Return the templates of reports, with texts escaped for Markdown instead of HTML."""
    return templates("report").overlay(autoescape=False, finalize=_escaped_text)


def _escaped_text(value: Any) -> Any:  # noqa: ANN401 - whatever a template inserts
    return escaped(value) if type(value) is str else value


def escaped(text: object) -> MarkdownText:
    """Return a text escaped so that Markdown shows it literally: no markup, HTML, links, mentions or table cells."""
    plain = _SPECIAL.sub(lambda sign: f"&#{ord(sign[0])};", safe(text, _LONGEST_TEXT))
    return MarkdownText(_LINKS.sub(_APART, plain))


def code(text: object) -> MarkdownText:
    """Return a text as inline code that may also be in the cell of a table."""
    plain = safe(text, _LONGEST_TEXT)
    fence = "`" * (max((len(run) for run in re.findall("`+", plain)), default=0) + 1)
    pad = " " if plain.startswith("`") or plain.endswith("`") else ""
    return MarkdownText(f"{fence}{pad}{plain}{pad}{fence}".replace("|", "\\|")) if plain.strip() else MarkdownText("")


def block(text: str, language: str) -> MarkdownText:
    """Return lines as a block of code; backticks in them do not end it."""
    lines = [safe(line, _LONGEST_CODE) for line in text.split("\n")]
    fence = "`" * max(3, max((len(run) for line in lines for run in re.findall("`+", line)), default=0) + 1)
    return MarkdownText("\n".join([f"{fence}{language}", *lines, fence]))


def as_text(contents: Contents) -> str:
    """Return the headline and a paragraph for each finding to act on: its story, its changes, and the command that runs
    it; a line for each of the others; then the broken expectations of mutants without another failure.
    """
    blocks = ["\n".join([safe(contents.headline), safe(contents.subtitle), *map(safe, contents.notes)])]
    blocks += ["\n".join(_lines(finding)) for finding in contents.findings if not finding.folded]
    if contents.folded:
        lines = [f"  {safe(finding.name)}: {safe(finding.title)}" for finding in contents.folded]
        blocks.append("\n".join([f"{safe(contents.folded_text)}:", *lines]))
    if (broken := contents.breaking) is not None and broken.rows:
        lines = [", ".join(filter(None, map(safe, row))) for row in (*broken.rows, *filter(None, [broken.total]))]
        blocks.append("\n".join([broken.title, *(f"  {line}" for line in lines)]))
    return "\n\n".join(blocks) + "\n"


def _lines(finding: FindingEntry) -> list[str]:
    first = finding.runs[0]
    answers = [
        f"{R157}: {finding.preventability}" if finding.preventability else "",
        f"{ANTICIPATING}: {finding.anticipation}" if finding.anticipation else "",
    ]
    kinds = [
        f"fails in {finding.record.rate} runs" if finding.record.rate else finding.verdict,
        finding.record.class_,
        *answers,
        f"family {finding.record.family}" if finding.record.family else "",
    ]
    lines = [f"{safe(finding.name)}", f"  {safe(finding.title)}", f"  {safe(', '.join(k for k in kinds if k))}"]
    lines += [f"  {safe(finding.standing)}"] if finding.standing else []
    lines += [f"  {safe(line, 10_000)}" for line in first.changes]
    lines += [f"  {finding.sure.failed} of {finding.sure.seeds} sensor seeds fail"] if finding.sure else []
    lines += [f"  {safe(command, 10_000)}" for _, command in first.commands]
    if finding.count > 1:
        others = [*finding.others, *finding.more]
        lines.append(f"  the same story: {safe(', '.join(others), 10_000)}")
    return lines + [f"  {safe(note)}" for note in first.missing]

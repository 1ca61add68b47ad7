"""Pages of the site that are written from the code: all commands with their options, and all codes of messages.

mkdocs calls `on_files` (`hooks` in mkdocs.yml). The pages are not stored, so they say what the installed version does.
"""

import re
from collections.abc import Iterator
from typing import Any

import typer
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

from foresee_dsl.cli import app
from foresee_dsl.language.codes import every_code

COMMANDS = """# Commands

For everyone who looks up an option. `foresee COMMAND --help` prints the same. This page is written from the code,
with the commands of the installed plug-ins.
"""
CODES = """# Codes of messages

For everyone who has a message with a code. `foresee explain CODE` prints the same in the terminal, with examples. This
page is written from the code.

| code | meaning | what to do |
| --- | --- | --- |
"""


def commands() -> str:
    """Return the page of all commands."""
    group = typer.main.get_command(app)
    context = group.make_context("foresee", [], resilient_parsing=True)
    return COMMANDS + "".join(_sections(group, context, "foresee"))


def _sections(group: Any, context: Any, path: str) -> Iterator[str]:  # noqa: ANN401 - typer keeps their types to itself
    for name in group.list_commands(context):
        _, command, _ = group.resolve_command(context, [name])  # imports a plug-in's command
        inside = command.make_context(name, [], parent=context, resilient_parsing=True)
        title = f"{path} {name}"
        words, _, examples = (command.help or "").partition("[dim]")
        yield f"\n## {title}\n\n{_plain(words).strip()}\n"
        if examples:
            yield f"\n```\n{_plain(examples).strip()}\n```\n"
        if hasattr(command, "list_commands"):
            yield from _sections(command, inside, title)
            continue
        rows = [parameter.get_help_record(inside) for parameter in command.get_params(inside)]
        cells = [(_cell(row[0], code=True), _cell(row[1])) for row in rows if row]
        yield "\n| option | what it does |\n| --- | --- |\n" + "".join(f"| {name} | {text} |\n" for name, text in cells)


def codes() -> str:
    """Return the page of all codes."""
    rows = (f"| `{code.code}` | {_cell(code.title)} | {_cell(code.explanation)} |\n" for code in every_code().values())
    return CODES + "".join(rows)


def _plain(text: str) -> str:
    """Return a help text without rich's markup."""
    return re.sub(r"\\\[", "[", re.sub(r"(?<!\\)\[/?(?:dim|bold|italic)\]", "", text))


def _cell(text: str, *, code: bool = False) -> str:
    """Return a text as a cell of a table, in which a bar is escaped and nothing is read as HTML."""
    words = " ".join(_plain(text).split())
    return f"`{words}`" if code else words.replace("|", r"\|").replace("<", "&lt;")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages to those that are read from files; this module itself is not one."""
    files.remove(files.get_file_from_path("pages.py"))
    for name, text in (("commands", commands()), ("codes", codes())):
        files.append(File.generated(config, f"reference/{name}.md", content=text))
    return files

"""Reports' templates (`templates/report`): autoescaped, and a name that is not given is an error."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from foresee_dsl.files import data_folder

if TYPE_CHECKING:
    from jinja2 import Environment


def rendered(template: str, **values: object) -> str:
    """Return the text that `templates/report/<template>.j2` gives with all the values that it names."""
    return environment().get_template(f"{template}.j2").render(**values)


@cache
def environment() -> Environment:
    """Return the environment of the reports' templates."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    return Environment(
        loader=FileSystemLoader(data_folder("templates") / "report"),
        undefined=StrictUndefined,
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )

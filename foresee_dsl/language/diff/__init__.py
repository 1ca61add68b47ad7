"""What differs in meaning between two files, in words and as an edit script.

    changes = diff_models(a, b)     # runner.speed: 50 km/h => 60 km/h (+10 km/h)
    apply(a, changes)               # means what b means

`compare` finds the differences, `matching` says which statement is which, `wording` words them, `applying` makes them,
`rendering` shows them, `addresses` reads the files, `plain` writes a file for `git diff`.
"""

from foresee_dsl.language.diff.addresses import (
    Comparison,
    compare_addresses,
    diff_addresses,
    diff_cases,
    parent_address,
)
from foresee_dsl.language.diff.applying import apply
from foresee_dsl.language.diff.compare import diff_models
from foresee_dsl.language.diff.parts import (
    GROUPS,
    Difference,
    Edit,
    Group,
    edit_from_dict,
    edit_to_dict,
    to_dict,
)
from foresee_dsl.language.diff.plain import plain_text, texts
from foresee_dsl.language.diff.rendering import render_groups, render_markdown, render_text

__all__ = [
    "GROUPS",
    "Comparison",
    "Difference",
    "Edit",
    "Group",
    "apply",
    "compare_addresses",
    "diff_addresses",
    "diff_cases",
    "diff_models",
    "edit_from_dict",
    "edit_to_dict",
    "parent_address",
    "plain_text",
    "render_groups",
    "render_markdown",
    "render_text",
    "texts",
    "to_dict",
]

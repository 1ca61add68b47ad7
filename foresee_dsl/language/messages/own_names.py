"""Replaces names in the examples of helps by names from the author's file: `ego in junction middle` instead of `j4`."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

from foresee_dsl.errors import Diagnostic
from foresee_dsl.helps import GoOn, InBlock, Instead, Write

_DECLARED = {
    "junction": re.compile(r"\b(?:junction|roundabout)\s+([a-z]\w*)\s+at\b"),
    "road": re.compile(r"\broad\s+([a-z]\w*)\s+from\b"),
    "vehicle": re.compile(r"\b(?:vehicle|bicycle)\s+([a-z]\w*)\s*:"),
    "pedestrian": re.compile(r"\bpedestrian\s+([a-z]\w*)\s*:"),
}
"""The pattern that declares a name of each kind in a text."""
_EXAMPLES = {"j4": "junction", "west": "road", "runner": "vehicle", "lead": "vehicle", "walker": "pedestrian"}
"""The names that occur in the examples of helps, each with its kind."""
_CODE = re.compile(r"`[^`]*`")
_NAME = re.compile(r"(?<![\w.\"])(?P<before>(?:junction|roundabout|road|vehicle|bicycle|pedestrian)\s+)?"
                   rf"(?P<name>{'|'.join(_EXAMPLES)})(?![\w\"])")  # fmt: skip
_COMMENT = re.compile(r"#[^\n]*")


def with_own_names(diagnostics: Iterable[Diagnostic], text: str) -> tuple[Diagnostic, ...]:
    """Return the diagnostics with new helps: each example name that does not occur in the text is replaced by a name
    that does."""
    listed = tuple(diagnostics)
    if not any(_NAME.search(diagnostic.help) for diagnostic in listed):
        return listed
    own = dict(_own(_COMMENT.sub("", text)))
    return tuple(
        replace(
            diagnostic,
            help=_CODE.sub(lambda code: _renamed(code[0], own), diagnostic.help),
            fixes=tuple(
                replace(fix, text=_renamed(fix.text, own)) if isinstance(fix, Write | Instead | GoOn | InBlock) else fix
                for fix in diagnostic.fixes
            ),
        )
        for diagnostic in listed
    )


def _own(text: str) -> Iterator[tuple[str, str]]:
    """Yield each example name with its replacement. Each name of the text is used once, and the most frequent name
    first."""
    uses = Counter(re.findall(r"\w+", text))
    left = {
        kind: sorted(dict.fromkeys(pattern.findall(text)), key=lambda name: -uses[name])
        for kind, pattern in _DECLARED.items()
    }
    for name, kind in _EXAMPLES.items():
        if left[kind] and not re.search(rf"\b{name}\b", text):
            yield name, left[kind].pop(0)


def _renamed(code: str, own: Mapping[str, str]) -> str:
    """Return code in which example names are replaced by names of the text.

    A name that the code declares (`vehicle runner: ...`) stays, and so does a name that stands alone, because it only
    shows how names are written.
    """
    if code.strip("`") in _EXAMPLES:
        return code
    declared = {match["name"] for match in _NAME.finditer(code) if match["before"] and not _is_used(code, match)}
    return _NAME.sub(
        lambda match: (
            match[0] if match["name"] in declared else f"{match['before'] or ''}{own.get(match['name'], match['name'])}"
        ),
        code,
    )


def _is_used(code: str, match: re.Match[str]) -> bool:
    """Return whether a name that follows the word for its kind is only used there (`ego in junction j4`), not
    declared."""
    return code[: match.start()].endswith("in ")

"""The names of examples in helps, replaced by names that the author's text has: `ego in junction middle`, not `j4`."""

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
"""How each kind of thing gets its name in a text."""
_EXAMPLES = {"j4": "junction", "west": "road", "runner": "vehicle", "lead": "vehicle", "walker": "pedestrian"}
"""The names that examples of the language use, and what they name."""
_CODE = re.compile(r"`[^`]*`")
_NAME = re.compile(r"(?<![\w.\"])(?P<before>(?:junction|roundabout|road|vehicle|bicycle|pedestrian)\s+)?"
                   rf"(?P<name>{'|'.join(_EXAMPLES)})(?![\w\"])")  # fmt: skip
_COMMENT = re.compile(r"#[^\n]*")


def with_own_names(diagnostics: Iterable[Diagnostic], text: str) -> tuple[Diagnostic, ...]:
    """Return diagnostics whose helps use the names in a text where those of the examples are not in it."""
    found = tuple(diagnostics)
    if not any(_NAME.search(diagnostic.help) for diagnostic in found):
        return found
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
        for diagnostic in found
    )


def _own(text: str) -> Iterator[tuple[str, str]]:
    """Yield the names of examples with what to write instead: each name of the text for one of them, the one that the
    text uses most first."""
    uses = Counter(re.findall(r"\w+", text))
    left = {
        kind: sorted(dict.fromkeys(pattern.findall(text)), key=lambda name: -uses[name])
        for kind, pattern in _DECLARED.items()
    }
    for name, kind in _EXAMPLES.items():
        if left[kind] and not re.search(rf"\b{name}\b", text):
            yield name, left[kind].pop(0)


def _renamed(code: str, own: Mapping[str, str]) -> str:
    """Return code with other names. A name that it declares (`vehicle runner: ...`) stays, and one that stands alone,
    which shows how names are written."""
    if code.strip("`") in _EXAMPLES:
        return code
    declared = {found["name"] for found in _NAME.finditer(code) if found["before"] and not _is_used(code, found)}
    return _NAME.sub(
        lambda found: (
            found[0] if found["name"] in declared else f"{found['before'] or ''}{own.get(found['name'], found['name'])}"
        ),
        code,
    )


def _is_used(code: str, found: re.Match[str]) -> bool:
    """Whether a name behind its kind's word is used there, as in `ego in junction j4`."""
    return code[: found.start()].endswith("in ")

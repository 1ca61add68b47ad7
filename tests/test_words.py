"""Names and phrases that a reader reads twice, each with its better form, in code, messages, templates and docs."""

from __future__ import annotations

import ast
import io
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
CODE = sorted(
    path
    for folder in ("foresee_dsl", "plugins", "benchmarks")
    for path in (ROOT / folder).rglob("*.py")
    if "tests" not in path.parts and "build" not in path.parts
)
PROSE = sorted([
    *(ROOT / "docs").rglob("*.md"),
    *(path for path in (ROOT / "templates").rglob("*") if path.is_file()),
    *(ROOT / "plugins").glob("*/README.md"),
    ROOT / "README.md",
])  # fmt: skip

NAMES = dict.fromkeys(
    ("found", "one", "known", "told", "made", "given", "asked", "shown", "tried", "took", "said"),
    "the noun of what it holds: an encounter, a path, a message",
)
"""Names of values, arguments, attributes and functions that say nothing."""

PHRASES = {
    "is no X": (r"(?<!here )\b(?:is|are|was|were) no (?!\w+er\b|more\b|less\b|\w+ (?:but|than)\b)`?\w+", "is not a X"),
    "Who stands ...": (r"(?:^|[.:;] )Who (?![^.\n]*\?)|\b[Ww]hoever\b", "An actor that stands ..."),
    "so many": (r"\b[Ss]o (?:many|near|often|late|early|high|low)\b(?! that)", "the number, with its unit"),
    "somebody": (r"\b(?:[Ss]ome|[Nn]o|[Ee]very)body\b", "an actor, no actor, all actors (or: anyone, no one)"),
    "mend": (r"\b[Mm]end(?:s|ed|ing)?\b|\b[Rr]eckon(?:s|ed|ing)?\b|\bhangs? on\b", "fix, compute, depend on"),
}
"""Phrases, as regular expressions, and what to write instead."""

ANY = re.compile("|".join(pattern for pattern, _ in PHRASES.values()), re.MULTILINE)

IN_FILES = {
    ("foresee_dsl/campaign/findings/review.py", "asked"),
    ("foresee_dsl/campaign/storage/maintenance.py", "known"),
    ("foresee_dsl/derive/minimise/outcome.py", "tried"),
    ("foresee_dsl/language/model/derived.py", "found"),
    ("foresee_dsl/simulate/trigger_record.py", "known"),
    ("foresee_dsl/story/story.py", "somebody"),
    ("docs/guide/findings.md", "somebody"),
    ("docs/reference/glossary.md", "somebody"),
    ("plugins/foresee-learned/training/models/fusion_safe.py", "asked"),
    ("plugins/foresee-study/foresee_study/folder.py", "asked"),
    ("plugins/foresee-study/foresee_study/faults/measures.py", "said"),
}
"""Fields, words and values that are written to files and read back: another name would make older files unreadable."""


def names(nodes: list[ast.AST]) -> Iterator[tuple[int, str]]:
    """Yield the line and the name of everything that gets a name."""
    for node in nodes:
        match node:
            case ast.Name(id=name, ctx=ast.Store()) | ast.arg(arg=name) | ast.FunctionDef(name=name):
                yield node.lineno, name.strip("_")
            case ast.Attribute(attr=name, ctx=ast.Store()):
                yield node.lineno, name.strip("_")
            case ast.ClassDef(name=name):
                yield node.lineno, name.strip("_").lower()


def texts(source: str, nodes: list[ast.AST]) -> Iterator[tuple[int, str]]:
    """Yield the line and the text of every string and comment."""
    for node in nodes:
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.lineno, node.value
    # What stands behind a `#` may be a comment; only where one has a phrase are all tokens read, which takes long.
    if any(ANY.search(rest[1].strip()) for rest in re.finditer(r"#(?=(.*))", source)):
        for token in tokenize.generate_tokens(io.StringIO(source).readline):
            if token.type == tokenize.COMMENT:
                yield token.start[0], token.string.removeprefix("#").strip()


def allowed(hit: tuple[str, str, str]) -> bool:
    """Return whether a place is one of `IN_FILES`."""
    return (hit[0].rpartition(":")[0], hit[1]) in IN_FILES


def every_place() -> Iterator[tuple[str, str, str]]:
    """Yield each place with the kind of offence and the word that offends."""
    for path in CODE:
        where = path.relative_to(ROOT).as_posix()
        source = path.read_text(encoding="utf-8")
        nodes = list(ast.walk(ast.parse(source)))
        yield from ((f"{where}:{line}", name, name) for line, name in names(nodes) if name in NAMES)
        for line, text in texts(source, nodes):
            if not ANY.search(text):
                continue
            for kind, (pattern, _) in PHRASES.items():
                yield from ((f"{where}:{line}", kind, hit.group()) for hit in re.finditer(pattern, text))
    for path in PROSE:
        where = path.relative_to(ROOT).as_posix()
        for number, text in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
            if not ANY.search(text):
                continue
            for kind, (pattern, _) in PHRASES.items():
                yield from ((f"{where}:{number}", kind, hit.group()) for hit in re.finditer(pattern, text))


def test_a_reader_need_not_read_twice() -> None:
    # One test: workers that shared several would each read all files.
    places = list(every_place())
    hits = [hit for hit in places if not allowed(hit)]
    listed = "\n".join(
        f"{place}: {word!r}; write {NAMES.get(kind) or PHRASES[kind][1]}" for place, kind, word in hits[:40]
    )
    assert not hits, f"{len(hits)} names and phrases that are read twice:\n{listed}"
    unneeded = IN_FILES - {(place.rpartition(":")[0], kind) for place, kind, _ in places}
    assert not unneeded
    assert len(IN_FILES) < 20


def test_the_patterns_find_what_they_are_for() -> None:
    hits = [kind for sentence in BAD for kind, (pattern, _) in PHRASES.items() if re.search(pattern, sentence)]
    assert hits == list(PHRASES)
    assert not [good for good in GOOD for pattern, _ in PHRASES.values() if re.search(pattern, good)]


BAD = (
    "`walker` is no kind of actor",
    "Who stood before the ego waits.",
    "So many metres of way",
    "nobody was in the way",
    "the mending of a file hangs on it",
)
GOOD = (
    "there is no road called west",
    "Who drives?",
    "it is no longer than 3 m",
    "so near that it touches",
    "no actor is in the way; an actor that waits",
)
if __name__ == "__main__":  # python tests/test_words.py [PATH...]: lists all places below these paths
    import sys

    for hit in every_place():
        place, _, word = hit
        if not allowed(hit) and (not sys.argv[1:] or any(place.startswith(start) for start in sys.argv[1:])):
            print(f"{place}: {word!r}")  # noqa: T201

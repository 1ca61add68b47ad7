"""One table of words: held against the grammar and the model, and read by both highlighters."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Iterator
from importlib.metadata import entry_points
from pathlib import Path

import pytest
from lark.lexer import PatternStr
from pygments.token import Comment, Error, Keyword, Name, Number, Operator, String

from foresee_dsl.editor import textmate
from foresee_dsl.editor.highlight import highlighted
from foresee_dsl.editor.lexer import NAMED, ForeseeLexer
from foresee_dsl.language import model as m
from foresee_dsl.language.keywords import KEYWORDS, USAGE, words_of
from foresee_dsl.language.model.pattern import form_of
from foresee_dsl.language.syntax.grammar import parser
from foresee_dsl.language.units import UNITS

TABLE = "the `words` of a class in foresee_dsl/language/model"


def model_words() -> frozenset[str]:
    """Every fixed word that a field of the model takes."""
    fields = [(kind, field) for kind in m.ITEMS for field in kind.model_fields if field != "kind"]
    return frozenset(w for kind, field in fields for w in form_of(kind, field).words if w[0].isalpha())


def grammar_words() -> set[str]:
    texts = (t.pattern.value for t in parser().terminals if isinstance(t.pattern, PatternStr))
    return {text for text in texts if text[0].isalpha()}


def test_the_table_has_every_word_of_the_grammar() -> None:
    missing = sorted(grammar_words() - KEYWORDS.keys())
    rows = "\n".join(f"        {word} (GROUP): WHAT IT MEANS | A LINE WITH {word}" for word in missing)
    assert not missing, f"add to {TABLE}:\n{rows}"


def test_the_table_has_no_word_that_is_not_in_the_grammar() -> None:
    left = sorted({w for w, k in KEYWORDS.items() if k.group not in ("type", "constant")} - grammar_words())
    assert not left, f"remove from {TABLE} (grammars/foresee.lark does not have them any more): {', '.join(left)}"


def test_the_table_has_every_word_that_the_model_takes() -> None:
    known = model_words() | set(m.SIGNAL_COLOURS) | set(UNITS)
    missing = sorted(model_words() - KEYWORDS.keys())
    assert not missing, f"add to the group `type` or `constant` of {TABLE}: {', '.join(missing)}"
    left = sorted(set(words_of("type", "constant")) - known)
    assert not left, f"remove from {TABLE} (no field of the model takes them any more): {', '.join(left)}"


def test_every_word_has_a_meaning_and_an_example_that_shows_it() -> None:
    for word, keyword in KEYWORDS.items():
        assert keyword.meaning and not keyword.meaning.endswith("."), word
        assert re.search(rf"\b{word}\b", keyword.example), f"the example of {word} is without it"
        assert len(keyword.example) < 100
    assert all(KEYWORDS[word].example == usage for word, usage in USAGE.items())
    assert set(NAMED) <= KEYWORDS.keys()


def test_measures_have_a_dimension() -> None:
    assert set(m.MEASURED) == set(form_of(m.Measure, "what").words)


# ---- Pygments -------------------------------------------------------------------------------------------------------


def samples(root: Path) -> Iterator[Path]:
    yield from (root / "scenarios").rglob("*.foresee")
    yield from (root / "tests" / "cases" / "language").rglob("*.foresee")


def test_no_file_has_a_token_that_is_an_error(root: Path) -> None:
    files = list(samples(root))
    assert len(files) > 10
    for file in files:
        text = file.read_text(encoding="utf-8", errors="replace")
        tokens = list(ForeseeLexer().get_tokens_unprocessed(text))
        assert "".join(value for _, _, value in tokens) == text
        assert not [token for token in tokens if token[1] in Error], file


def test_what_words_are_highlighted_as() -> None:
    text = (
        "foresee 1  # first\n"
        "scenario speed {\n"
        '  doc "a scenario"\n'
        "  vehicle start: car.compact {\n"
        "    speed 50 km/h\n"
        "    route from west straight over j4\n"
        "  }\n"
        "  case r01 { gap = 1.2 s }\n"
        "  when ego.speed > 3 m/s^2 and time > 4 s { ego stops }\n"
        "}\n"
    )
    found = [(value, token) for _, token, value in ForeseeLexer().get_tokens_unprocessed(text) if value.strip()]
    expected = [
        ("# first", Comment.Single),
        ("scenario", Keyword.Declaration),
        ("speed", Name.Class),
        ('"a scenario"', String.Double),
        ("start", Name.Class),
        ("car", Name.Variable),
        ("speed", Keyword),
        ("50", Number),
        ("km/h", Keyword.Type),
        ("from", Keyword.Pseudo),
        ("west", Name),
        ("straight", Name.Constant),
        ("gap", Name.Variable),
        ("m/s^2", Keyword.Type),
        ("and", Operator.Word),
        ("stops", Keyword),
    ]
    left = iter(found)
    for pair in expected:
        assert pair in left, pair  # each behind the one before it


def test_the_lexer_is_registered() -> None:
    (found,) = entry_points(group="pygments.lexers", name="foresee")
    assert found.load() is ForeseeLexer


def test_highlighting_keeps_every_character() -> None:
    text = 'foresee 1\n\n\tscenario "open [red] \\[x] 🚗 § \x00\n{ } ...'
    assert highlighted(text).plain == text


def test_the_language_does_not_pull_in_what_editors_need() -> None:
    code = (
        "import sys, foresee_dsl.language.project.loading, foresee_dsl.language.parser\n"
        "from foresee_dsl.editor.highlight import show; show('')\n"
        "print([m for m in ('pygls', 'lsprotocol', 'pygments', 'rich', 'numpy') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


# ---- TextMate -------------------------------------------------------------------------------------------------------


def test_the_textmate_grammar_is_up_to_date(root: Path) -> None:
    kept = (root / textmate.FILE).read_text(encoding="utf-8")
    assert kept == textmate.text(), f"write it again: python -m foresee_dsl.editor.textmate > {textmate.FILE}"


def scopes(line: str) -> list[tuple[str, str]]:
    """Tokenise a line as an editor does: at each place the first rule that matches there, the leftmost match wins."""
    rules = [(re.compile(rule["match"]), rule) for rule in textmate.grammar()["patterns"]]
    found: list[tuple[str, str]] = []
    at = 0
    while at < len(line):
        matches = [(m_.start(), k, m_) for k, (p, _) in enumerate(rules) if (m_ := p.search(line, at)) and m_.group()]
        if not matches:
            break
        _, k, match = min(matches, key=lambda item: item[:2])
        rule = rules[k][1]
        if "name" in rule:
            found.append((match.group(), rule["name"]))
        for group, scope in rule.get("captures", {}).items():
            if match.group(int(group)) is not None:
                found.append((match.group(int(group)), scope["name"]))
        at = match.end()
    return found


SCOPED = """
foresee 1 -> foresee keyword.declaration, 1 constant.numeric
vehicle start: car.compact { -> vehicle keyword.declaration, start entity.name
  speed 50 km/h -> speed keyword.control.statement, 50 constant.numeric, km/h keyword.other.unit
  start at -4.5 m along ego.route -> -4.5 constant.numeric, m keyword.other.unit, along keyword.other
  walker_2 meets ego2  # speed -> walker_2 variable.other, meets keyword.control, #_speed comment.line
  doc "50" -> doc keyword.control.statement, "50" string.quoted.double
  doc "50 -> "50 invalid.illegal
  case r01 { gap = 1.2 s } -> r01 entity.name, gap variable.parameter, 1.2 constant.numeric, s keyword.other.unit
  change a.steer: 0.00 => 0.12 -> steer variable.other.property, 0.00 constant.numeric, => keyword.operator
  acceleration 3 m/s^2 -> acceleration variable.other.property, m/s^2 keyword.other.unit
  when not time > 1 s and ego.eta(j4) < 2 s { -> not keyword.operator.word, and keyword.operator.word
clip a of "b" pin sha256:5ef2c6120a41 { -> a entity.name, sha256:5ef2c6120a41 constant.other.pin
"""


@pytest.mark.parametrize("row", SCOPED.strip("\n").split("\n"))
def test_textmate_scopes(row: str) -> None:
    line, _, expected = row.rpartition(" -> ")
    found = scopes(line)
    for pair in expected.split(", "):
        word, scope = pair.split()
        assert any(w.replace(" ", "_") == word and s.startswith(scope) for w, s in found), (pair, found)


def test_textmate_reads_every_file(root: Path) -> None:
    texts = [file.read_text(encoding="utf-8", errors="replace") for file in samples(root)]
    for line in dict.fromkeys(line[:500] for text in texts for line in text.split("\n")):  # some are 20,000 long
        shown = "".join(word for word, _ in scopes(line))
        assert len(shown) <= len(line), line  # nothing twice


def test_the_extension_names_files_that_are_there(root: Path) -> None:
    folder = root / "editors" / "vscode"
    package = json.loads((folder / "package.json").read_text(encoding="utf-8"))
    contributes = package["contributes"]
    (language,), (grammar,) = contributes["languages"], contributes["grammars"]
    assert language["id"] == grammar["language"] == ForeseeLexer.name
    assert language["extensions"] == [".foresee"]
    assert grammar["scopeName"] == textmate.grammar()["scopeName"]
    assert (folder / grammar["path"]).resolve() == (root / textmate.FILE).resolve()
    configuration = json.loads((folder / language["configuration"]).read_text(encoding="utf-8"))
    assert configuration["comments"] == {"lineComment": "#"}
    for pattern in (*configuration["indentationRules"].values(), configuration["wordPattern"]):
        re.compile(pattern)
    script = (folder / package["main"]).read_text(encoding="utf-8")
    for name in set(re.findall(r'require\("([^".][^"]*)"\)', script)) - {"vscode"}:
        assert name.split("/")[0] in package["dependencies"]
    commands = re.findall(r'registerCommand\("([^"]+)"', script)
    assert commands == [c["command"] for c in contributes["commands"]]
    # https://github.com/microsoft/vscode-languageserver-node: version 9 of the client needs VS Code 1.82.
    assert package["dependencies"]["vscode-languageclient"].startswith("^9.")
    assert package["engines"]["vscode"] == "^1.82.0"
    assert package["activationEvents"] == [f"onLanguage:{language['id']}"]

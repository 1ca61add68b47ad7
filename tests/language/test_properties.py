"""What holds for every model, every layout and every broken file."""

from __future__ import annotations

import random
import re
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from foresee_dsl.errors import InputError
from foresee_dsl.language import model as m
from foresee_dsl.language.checking import walk
from foresee_dsl.language.checks import check_document
from foresee_dsl.language.parser import format_text, parse
from foresee_dsl.language.printer import print_model

from .strategies import STATEMENTS, definitions

ROOT = Path(__file__).parents[2]
SAMPLES = sorted((ROOT / "tests" / "cases" / "language").glob("*.foresee")) + sorted(
    (ROOT / "scenarios").rglob("*.foresee")
)
TEXTS = {str(file.relative_to(ROOT)): file.read_text(encoding="utf-8") for file in SAMPLES}

few = settings(
    max_examples=100, derandomize=True, deadline=None, database=None, suppress_health_check=list(HealthCheck)
)


@pytest.mark.parametrize(("host", "kind"), STATEMENTS, ids=lambda part: getattr(part, "__name__", part))
def test_a_printed_model_reads_back(host: str, kind: type[m.Item]):
    seen = []

    @settings(few, max_examples=8)
    @given(definitions(host, kind))
    def reads_back(model: m.Definition) -> None:
        text = print_model(model)
        document = parse(text, "x")
        assert document.model == model
        assert format_text(text, "x") == text
        check_document(document)
        seen.extend(item for item in walk(model) if isinstance(item, kind))

    reads_back()
    assert seen


@pytest.mark.parametrize("name", TEXTS)
def test_samples_read_back(name: str):
    document = parse(TEXTS[name], name)
    assert check_document(document) == ()
    assert parse(print_model(document.model), name).model == document.model
    assert parse(print_model(document.model, document.comments), name).model == document.model


def decorated(text: str, rng: random.Random) -> str:
    """The same file with comments and blank lines thrown in, and another indentation."""
    lines = []
    for k, line in enumerate(text.split("\n")):
        for _ in range(rng.choice([0, 0, 0, 1, 2])):
            lines.append(rng.choice(["", "", f"  # before {k}", "#", f"#tight {k}", "\t#  wide"]))
        plain = line.strip()
        if plain and "#" not in plain and rng.random() < 0.2:
            plain += rng.choice([f"  # after {k}", f" #{k}", ";" if plain[-1] not in "{}" and k > 2 else ""])
        lines.append(rng.choice(["", " ", "\t", "        "]) + plain)
    return rng.choice(["\n", "\r\n"]).join(lines)


@settings(few, max_examples=40)
@given(st.sampled_from(sorted(TEXTS)), st.integers(0, 10**6))
def test_formatting_keeps_comments_and_meaning_and_is_stable(name: str, seed: int):
    text = decorated(TEXTS[name], random.Random(seed))
    once = format_text(text, name)  # refuses to lose a comment or to change the meaning
    assert parse(once, name).model == parse(TEXTS[name], name).model
    assert format_text(once, name) == once
    remarks = re.findall(r"# ?((?:before|after|tight) \d+)", text)
    assert sorted(remarks) == sorted(re.findall(r"# ?((?:before|after|tight) \d+)", once))


@pytest.mark.parametrize("name", TEXTS)
def test_a_changed_value_is_one_changed_line(name: str):
    document = parse(format_text(TEXTS[name], name), name)
    lines = document.text.split("\n")
    quantities = [item for item in walk(document.model) if isinstance(item, m.Quantity)]
    for quantity in random.Random(1).sample(quantities, min(25, len(quantities))):
        span = document.span(quantity, "value")
        assert span is not None and span.line == span.end_line
        line = lines[span.line - 1]
        changed = [*lines]
        changed[span.line - 1] = f"{line[: span.column - 1]}77123{line[span.end_column - 1 :]}"
        again = format_text("\n".join(changed), name).split("\n")
        assert again == changed
        assert len(again) == len(lines)


ALPHABET = (*'{}[]();:=.,<>"#-0123456789 \n\tabz_é²\x00\x1b\u2028', " speed ", " 3 m ", "ego.", " when ", "..", "=>")


def mutated(text: str, rng: random.Random) -> str:
    for _ in range(rng.randint(1, 4)):
        at = rng.randrange(len(text) + 1)
        length = rng.choice([1, 1, 2, 5, 30])
        kind = rng.randrange(4)
        if kind == 0:
            text = text[:at] + text[at + length :]
        elif kind == 1:
            text = text[:at] + rng.choice(ALPHABET) + text[at:]
        elif kind == 2:
            text = text[:at] + text[at : at + length] + text[at:]
        else:
            other = rng.randrange(len(text) + 1)
            text = text[:at] + text[other : other + length] + text[at + length :]
    return text


@few
@given(st.sampled_from(sorted(TEXTS)), st.integers(0, 10**6))
def test_broken_files_end_in_diagnostics(name: str, seed: int):
    text = mutated(TEXTS[name], random.Random(seed))
    try:
        check_document(parse(text, name))
    except InputError as error:
        assert error.diagnostics
        for diagnostic in error.diagnostics:
            assert diagnostic.message and "this is not how" not in diagnostic.message
            assert diagnostic.path == name
    else:
        format_text(text, name)


@few
@given(st.text(st.sampled_from('foresee 1scenario{}\n"#.<a')) | st.text())
def test_any_text_ends_in_diagnostics(text: str):
    for start in ("", "foresee 1\n", "foresee 1\nscenario a {\n"):
        with pytest.raises(InputError):
            parse(f"{start}{text}\n!", "x")

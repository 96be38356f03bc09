"""Every key of a TOML text is found on the line on which it stands."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import pytest
from hypothesis import assume, given, reject
from hypothesis import strategies as st

from foretwin.contracts.toml_lines import Place, line_at, lines_of

ROOT = Path(__file__).parents[2]
TEXT = '''# a comment = 1
a = 1
"b.c" = [ # x = 2
  1, 2,
  "x = [3", """m
  y = 2
""",
]
d.e.f = {g = 1, h = [{i=2}]}
[t]
u = "[w]" # [z]
[[v]]
w = 2
[[v]]
w = 3
[v.z]
q = \'\'\'
a = 3\'\'\'
[[v.list]]
n = "\\"]"
[[v.list]]
n = 2
[last]
x = 1'''


@pytest.mark.parametrize(
    ("place", "line"),
    [
        (("a",), 2),
        (("b.c",), 3),
        (("b.c", 2), 5),
        (("d", "e", "f", "h", 0, "i"), 9),
        (("t", "u"), 11),
        (("v", 0), 12),
        (("v", 0, "w"), 13),
        (("v", 1, "w"), 15),
        (("v", 1, "z", "q"), 17),
        (("v", 1, "list", 1, "n"), 22),
        (("last", "x"), 24),
    ],
)
def test_a_key_stands_on_its_line(place: Place, line: int) -> None:
    tomllib.loads(TEXT)
    assert lines_of(TEXT)[place] == line


@pytest.mark.parametrize("quotes", [3, 4, 5])
def test_a_text_may_end_in_quotes_of_its_own(quotes: int) -> None:
    text = f'a = ["""b{quotes * chr(34)}]\nc = 1'
    assert tomllib.loads(text)["c"] == 1
    assert lines_of(text)[("c",)] == 2


def test_what_is_not_there_is_sought_around_it() -> None:
    lines = lines_of(TEXT)
    assert line_at(lines, ("v", 1, "missing")) == 14
    assert line_at(lines, ("nowhere",)) is None


def places(values: Any, around: Place = ()) -> set[Place]:
    """Return the place of everything in what a TOML text holds."""
    inner = values.items() if isinstance(values, dict) else enumerate(values)
    found = set()
    for step, value in inner:
        found.add((*around, step))
        if isinstance(value, dict | list):
            found |= places(value, (*around, step))
    return found


FILES = sorted(
    path
    for pattern in ("sim_worker/**/*.toml", "telemetry/**/*.toml", "examples/**/*.toml", "*.toml")
    for path in ROOT.glob(pattern)
)


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_in_every_file_of_ours_each_key_stands_on_a_line_that_names_it(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    lines, rows = lines_of(text), text.splitlines()
    assert set(lines) == places(tomllib.loads(text))
    for place, line in lines.items():
        key = next(step for step in reversed(place) if isinstance(step, str))
        if isinstance(place[-1], str):
            assert key in rows[line - 1]


SIMPLE = st.text("ab=[]{}#'\"\\\n,. 1", max_size=8).map(
    lambda text: '"' + text.translate({92: "\\\\", 34: '\\"', 10: "\\n"}) + '"'
)
VALUES = st.recursive(
    SIMPLE | st.integers(-9, 9).map(str) | st.sampled_from(["true", "1.5", "'#a = 1'"]),
    lambda inner: st.lists(inner, max_size=3).map(lambda items: f"[{', '.join(items)}]"),
    max_leaves=6,
)


@given(st.lists(VALUES, min_size=1, max_size=6))
def test_whatever_the_values_hold_keys_keep_their_lines(values: list[str]) -> None:
    text = "\n".join(f"key_{number} = {value}" for number, value in enumerate(values))
    tomllib.loads(text)
    lines = lines_of(text)
    assert [lines[f"key_{number}",] for number in range(len(values))] == [
        number + 1 for number in range(len(values))
    ]
    assert set(lines) == places(tomllib.loads(text))


PIECES = st.sampled_from(["a", '\\"', "\\\\", "\n", '"', '""', "'", "''", "#", "]", "= 1", "[t]"])
LONG = st.tuples(st.sampled_from(['"""', "'''", '"', "'"]), st.lists(PIECES, max_size=8)).map(
    lambda text: text[0] + "".join(text[1]) + text[0]
)


@given(st.lists(LONG, min_size=1, max_size=3))
def test_after_texts_in_any_quotes_the_next_key_stands_where_it_stands(texts: list[str]) -> None:
    rows = [f"key_{number} = {text} # end" for number, text in enumerate(texts)]
    text = "\n".join([*rows, "[last]", "x = 1"])
    try:
        values = tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        reject()
    assume(list(values) == [*(f"key_{number}" for number in range(len(texts))), "last"])
    lines = lines_of(text)
    assert set(lines) == places(values)
    begins = [
        1 + "\n".join(rows[:number]).count("\n") + (number > 0) for number in range(len(rows))
    ]
    assert [lines[f"key_{number}",] for number in range(len(rows))] == begins
    assert lines["last", "x"] == text.count("\n") + 1


@pytest.mark.parametrize("text", ["a = [1, 2", 'a = "b', "a = {b = 1", "[t", "a", "a = '''b"])
def test_of_a_text_that_ends_too_early_what_was_read_is_known(text: str) -> None:
    """It was no TOML, which others say."""
    assert set(lines_of(text)) <= {("a",), ("a", 0), ("a", 1), ("a", "b"), ("t",)}

"""Layouts of the viewer: those that come along, and one's own with what is wrong in it."""

from __future__ import annotations

from pathlib import Path

import pytest

from foretwin.contracts.errors import UserError
from foretwin.contracts.layout import LAYOUTS, VIEWS, read_layout


@pytest.mark.parametrize("name", LAYOUTS)
def test_those_that_come_along_can_be_used_and_hold_each_view_once(name: str) -> None:
    layout = read_layout(name)
    held = [
        one for column in layout.columns for row in column.rows for one in row.tabs + row.beside
    ]
    assert layout.purpose
    assert len(held) == len(set(held)) > 5
    assert "status" in held  # it names the map's source


def test_every_view_stands_in_one_of_them() -> None:
    held = {
        one
        for name in LAYOUTS
        for column in read_layout(name).columns
        for row in column.rows
        for one in row.tabs + row.beside
    }
    assert held == set(VIEWS)


def test_a_view_behind_a_tab_can_be_opened() -> None:
    layout = read_layout("drive").opened_at("map", "plan")
    tabs = [row.tabs for column in layout.columns for row in column.rows]
    assert ("map", "intersection", "chase") in tabs
    assert ("plan", "futures", "forecast", "how_sure", "engines", "lot") in tabs


def test_ones_own_is_a_file(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text('columns = [{rows = [{tabs = ["map"]}, {share = 2, beside = ["plan"]}]}]')
    (column,) = read_layout(str(file)).columns
    assert [row.share for row in column.rows] == [1.0, 2.0]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (
            'columns = [{rows = [{tabs = ["futurs"]}]}]',
            "line 1: columns[0].rows[0].tabs[0] 'futurs': did you mean futures? one of",
        ),
        ("columns = [{rows = [{}]}]", "each row needs either tabs = [...] or beside = [...]"),
        (
            'columns = [{rows = [{tabs = ["map"], beside = ["plan"]}]}]',
            "each row needs either tabs",
        ),
        ('columns = [{share = 0, rows = [{tabs = ["map"]}]}]', "each share is above 0"),
        ('columns = [{rows = [{share = -1, tabs = ["map"]}]}]', "each share is above 0"),
        ("columns = []", "holds no row of views"),
        ("rows = 3", "line 1: unknown key 'rows'; one of purpose, columns"),
        ("columns = [", "line 1: not TOML"),
    ],
)
def test_what_is_wrong_is_told_in_one_line(tmp_path: Path, text: str, told: str) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(text)
    with pytest.raises(UserError) as caught:
        read_layout(str(file))
    assert str(caught.value).startswith(f"--layout {file}: ")
    assert told in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_layout_that_is_not_there_names_those_that_are() -> None:
    with pytest.raises(UserError, match="did you mean identify"):
        read_layout("identity")

"""A measuring command that is told a map that is none says so in one line, and which there are."""

from __future__ import annotations

import pytest

from tests.world_gen import green_together, measure_stop_lines, measure_turns, where_lanes_lead
from tests.world_gen.data_maps import data_folder, named

NAMES = ("berlin", "berlin-mitte", "leeds")


def test_names_are_chosen_by_what_they_hold_in_their_order():
    assert named([], NAMES) == list(NAMES)
    assert named(["leeds", "mitte"], NAMES) == ["berlin-mitte", "leeds"]
    assert named(["berlin"], NAMES) == ["berlin"]


def test_a_word_that_no_name_holds_ends_the_command_with_code_2(capsys):
    with pytest.raises(SystemExit) as ended:
        named(["leeds", "leads"], NAMES)
    assert ended.value.code == 2
    assert capsys.readouterr().err == "leads is none of berlin, berlin-mitte, leeds\n"


@pytest.mark.parametrize("command", [green_together, where_lanes_lead])
def test_commands_that_take_words_say_it(command, capsys, monkeypatch, tmp_path):
    monkeypatch.setenv("FORETWIN_DATA", str(tmp_path))
    with pytest.raises(SystemExit, match="2"):
        command.main(["nowhere"])
    assert capsys.readouterr().err.startswith("nowhere is none of ")


@pytest.mark.parametrize("command", [measure_stop_lines, measure_turns])
def test_commands_with_options_say_it(command, capsys, monkeypatch, tmp_path):
    monkeypatch.setenv("FORETWIN_DATA", str(tmp_path))
    monkeypatch.setattr("sys.argv", ["measure", "nowhere"])
    with pytest.raises(SystemExit, match="2"):
        command.main()
    assert capsys.readouterr().err.startswith("nowhere is none of austin, ")


@pytest.mark.parametrize("folder", ["", "/nowhere/at/all"])
def test_without_a_folder_of_maps_a_command_says_so(folder, capsys, monkeypatch):
    monkeypatch.setenv("FORETWIN_DATA", folder)
    with pytest.raises(SystemExit, match="2"):
        data_folder()
    assert capsys.readouterr().err.count("\n") == 1

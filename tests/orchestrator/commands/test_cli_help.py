"""What a command's help says: in 80 columns, with an example that parses and true defaults."""

from __future__ import annotations

import re
import shlex
from typing import Any

import pytest
import typer

from foretwin.contracts.versions import versions
from foretwin.orchestrator.commands.cli import app, run
from foretwin.orchestrator.commands.cli_help import EXAMPLE
from foretwin.orchestrator.config import DriveConfig
from foretwin.world_gen.export.formats import FORMATS

COVERS = (
    "foretwin.orchestrator.commands.cli",
    "foretwin.orchestrator.commands.cli_drive",
    "foretwin.orchestrator.commands.cli_maps",
    "foretwin.orchestrator.commands.cli_options",
)
COLUMNS = 80


def commands() -> dict[str, Any]:
    """Every command by what is typed for it, groups too."""

    def below(command: Any, typed: str) -> dict[str, Any]:
        found = {typed: command}
        for name, one in getattr(command, "commands", {}).items():
            found |= below(one, f"{typed} {name}".strip())
        return found

    return below(typer.main.get_command(app), "")


COMMANDS = commands()
LEAVES = sorted(typed for typed, one in COMMANDS.items() if not hasattr(one, "commands"))


def help_of(typed: str, capsys: pytest.CaptureFixture[str], *, asked: str = "--help") -> str:
    assert run([*typed.split(), asked]) == 0
    return capsys.readouterr().out


@pytest.fixture(autouse=True)
def narrow(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", str(COLUMNS))


def test_there_are_commands() -> None:
    assert len(LEAVES) > 25


@pytest.mark.parametrize("typed", sorted(COMMANDS))
def test_help_fits_80_columns_and_h_is_help(typed: str, capsys: pytest.CaptureFixture[str]) -> None:
    shown = help_of(typed, capsys)
    assert max(map(len, shown.splitlines())) <= COLUMNS
    assert help_of(typed, capsys, asked="-h") == shown
    assert "…" not in shown.replace("KIND,…", "")
    assert "..." not in re.sub(r"\]\.\.\.|ARGS\]\.\.\.|[A-Z}>]\.\.\.", "", shown)


@pytest.mark.parametrize("typed", LEAVES)
def test_help_has_an_example_that_parses(typed: str, capsys: pytest.CaptureFixture[str]) -> None:
    shown = help_of(typed, capsys)
    (line,) = (line.strip() for line in shown.splitlines() if line.strip().startswith(EXAMPLE))
    program, *words = shlex.split(line.removeprefix(EXAMPLE))
    names = typed.split()
    assert [program, *words[: len(names)]] == ["foretwin", *names]
    with COMMANDS[typed].make_context(typed, words[len(names) :]) as context:
        assert context.params


@pytest.mark.parametrize("typed", LEAVES)
def test_no_argument_is_called_as_in_the_code(
    typed: str, capsys: pytest.CaptureFixture[str]
) -> None:
    usage = help_of(typed, capsys).split("\n\n")[0]
    assert re.search(r"\{[a-z_]+\}", usage) is None


def test_defaults_of_a_drive_are_those_of_its_settings(capsys: pytest.CaptureFixture[str]) -> None:
    shown = " ".join(help_of("drive", capsys).split())
    config, said = DriveConfig(), {}
    for option in COMMANDS["drive"].params:
        found = re.search(r"\[default: ([^\]]+)\]", option.help or "")
        name = {"map_file": "map"}.get(option.name, option.name)
        value = getattr(config, name, None)
        if isinstance(value, str | float | int) and not isinstance(value, bool):
            said[name] = found and found[1]
            assert found, f"{option.opts[0]} does not say its default"
            assert found[1] == (f"{value:g}" if isinstance(value, float | int) else value)
            assert f"[default: {found[1]}]" in shown
    assert said.keys() >= {"futures", "rate_hz", "horizon_s", "workers", "seed", "planner", "view"}


def test_a_choice_of_a_drive_is_said_in_its_help(capsys: pytest.CaptureFixture[str]) -> None:
    shown = " ".join(help_of("drive", capsys).split())
    for choices in ("auto, native, web", "off, report, apply", "log, standin, live", "auto, off"):
        assert choices in shown


def test_the_help_names_each_format_that_a_world_is_written_in(
    capsys: pytest.CaptureFixture[str],
) -> None:
    shown = " ".join(help_of("world", capsys).split())
    assert f"{', '.join(FORMATS)} [default:" in shown


def test_the_version_stands_in_a_line_with_those_of_its_libraries(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert run(["--version"]) == 0
    found = versions()
    assert capsys.readouterr().out == (
        f"foretwin {found['foretwin']} (Python {found['python']}, mujoco {found['mujoco']}, "
        f"zenoh {found['eclipse-zenoh']}, rerun {found['rerun-sdk']})\n"
    )


@pytest.mark.parametrize(
    ("line", "among"),
    [
        ("foretwin inter", ["intersections"]),
        ("foretwin drive --fut", ["--futures"]),
        ("foretwin map ", ["get", "town", "index"]),
    ],
)
def test_bash_completes_commands_and_options(
    line: str, among: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("_FORETWIN_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", line)
    monkeypatch.setenv("COMP_CWORD", str(line.count(" ")))
    with pytest.raises(SystemExit) as ended:
        run([])
    assert ended.value.code == 0
    assert capsys.readouterr().out.split() == among

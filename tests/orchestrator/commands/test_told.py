"""Each command says what it came to as JSON, and then stdout holds nothing else."""

from __future__ import annotations

import contextlib
import json
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pyarrow.parquet as pq
import pytest

from foretwin.contracts.bus import ZenohBus
from foretwin.contracts.errors import UserError
from foretwin.contracts.joining import newest_running
from foretwin.contracts.ports import free_endpoint
from foretwin.contracts.process_setup import BusSetup
from foretwin.orchestrator.commands.cli import run
from foretwin.orchestrator.commands.secure import begin
from foretwin.orchestrator.commands.told import CommandResult, print_told
from foretwin.orchestrator.embedded import MAP_FILE
from foretwin.sim_worker.scenarios import catalogue
from foretwin.world_gen.export.opendrive import write_opendrive
from tests.contracts.bus_sides import DEADLINE_S
from tests.orchestrator.commands.test_anchor import PLACE
from tests.orchestrator.commands.test_cli_help import COMMANDS, LEAVES
from tests.orchestrator.commands.test_declare import table, two_recordings
from tests.orchestrator.commands.test_map_get import BOX, MAP, Endpoint, Reply
from tests.orchestrator.commands.test_standin import EXAMPLE
from tests.orchestrator.lake.made_runs import made_run
from tests.orchestrator.sweeps import small_sweep
from tests.orchestrator.trip import town_world
from tests.system.foretwin_command import environment, run_folder, wait_for
from tests.telemetry.lot_car.test_braking import MAPPING

COVERS = (
    "foretwin.orchestrator.commands.drive",
    "foretwin.orchestrator.commands.map_index",
    "foretwin.orchestrator.commands.output",
    "foretwin.orchestrator.commands.set",
)
GO_ON = ["join", "view", "watch", "worker"]
"""Until they are ended: they have no result."""
WHILE_DRIVING = ["drive", "set"]
SCENARIO = Path(catalogue.__path__[0]) / "scp.toml"
AT = ",".join(map(str, PLACE))
BRIEF = """
worlds = "{worlds}"
scenarios = ["scp"]
cases = 1
planners = ["constant_speed"]
horizon_s = 1.0
"""
ASKED = {
    "anchor": f"{MAP_FILE} --at {AT}",
    "collect": "{run} --into {here}/lake",
    "compare": "{run} {here}/again",
    "config": "--example",
    "convert": "{log} {here}/drive.csv",
    "declare": "{here}/drive.csv",
    "doctor": "",
    "gap": "{log}",
    "identify": "{log}",
    "intersections": f"{MAP_FILE}",
    "judge": "{here}/again --vehicle city_bus --out {here}/judged",
    "learn-progress": "--check {log}",
    "lights": "{here}/town.xodr",
    "map get": f"{BOX} --out {{here}}/got.osm --config {{here}}/overpass.toml",
    "map index": f"{MAP_FILE} --folder {{here}}/index",
    "map town": "--out {here}/town.osm",
    "merge": "{here}/gnss.csv {here}/car.csv {here}/both.mcap",
    "query": "FROM+futures {run}",
    "recover": "{run}",
    "repeat": "{run} {future}",
    "report": "{run} --out {here}/report.html",
    "runs": "{run}",
    "scenarios": "",
    "scenarios check": f"{SCENARIO}",
    "scenarios draw": f"scp --map {MAP_FILE} --id n44 --out {{here}}/case.png",
    "scenarios export": f"scp --map {MAP_FILE} --id n44 --out {{here}}/case.xosc",
    "scenarios place": f"{MAP_FILE} --id n44 --scenario scp",
    "secure add": "car --folder {here}/campaign",
    "secure init": "--folder {here}/another",
    "secure show": "--folder {here}/campaign",
    "standin": "--ros2 {here}/ros2.toml --anchor {here}/lot.toml --end 1",
    "sweep": "{here}/small.toml --out {here}/swept --workers 1",
    "tracks add": "{log} --store {here}/store",
    "tracks delete": "--all --store {here}/store",
    "tracks list": "--store {here}/store",
    "world": f"{MAP_FILE} --id n44 --out {{here}}/n44.svg --report",
}
"""What is typed after each command; a plus is a blank within a word."""


class ShortDrive(NamedTuple):
    """A short drive in lock step: what it said as it ended, and what a change to it said."""

    folder: Path
    said: str
    change_said: str


def goes_on(out: Path) -> bool:
    try:
        return bool(newest_running(out))
    except UserError:
        return False


@pytest.fixture(scope="module")
def driven(tmp_path_factory: pytest.TempPathFactory) -> ShortDrive:
    folder = tmp_path_factory.mktemp("driven")
    out = folder / "runs"
    foretwin = [sys.executable, "-P", "-m", "foretwin"]
    few = ["--futures", "2", "--workers", "1", "--tuning", "off", "--view", "none"]
    words = ["drive", *few, "--speed", "max", "--end", "11", "--out", str(out), "--json"]
    around = environment(folder / "cache")
    with subprocess.Popen(
        [*foretwin, *words], env=around, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
    ) as driving:  # fmt: skip
        # A process for each look would take as long as the drive.
        wait_for(lambda: goes_on(out), "a drive that goes on")
        change_said, until_s = "", time.monotonic() + DEADLINE_S
        while not change_said and time.monotonic() < until_s:
            change_said = subprocess.run(
                [*foretwin, "set", "correction=free", "--out", str(out), "--json"],
                env=around, text=True, check=False,
                stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
            ).stdout  # fmt: skip
        said, _ = driving.communicate(timeout=DEADLINE_S)
    assert driving.returncode == 0
    made = run_folder(out)
    assert made is not None
    return ShortDrive(made, said, change_said)


@pytest.fixture
def here(driven: ShortDrive, tmp_path: Path) -> dict[str, Any]:
    """What commands are asked about, in a folder of its own."""
    future = pq.read_table(driven.folder / "results" / "futures.parquet").to_pylist()[0]
    shutil.copytree(driven.folder, tmp_path / "again")
    return {
        "here": tmp_path,
        "run": driven.folder,
        "log": driven.folder / "drive.mcap",
        "future": future["future_id"],
    }


def two_seconds_of(run: Path) -> None:
    """Let a run be one that was told to end soon: to drive all of it again takes as long."""
    record = json.loads((run / "run.json").read_text())
    record["config"]["end_s"] = 2.0
    (run / "run.json").write_text(json.dumps(record))


@contextlib.contextmanager
def prepared(typed: str, folder: Path) -> Iterator[None]:
    """What one command needs besides."""
    with contextlib.ExitStack() as open_until_asked:
        match typed.split():
            case ["judge"]:
                two_seconds_of(folder / "again")
            case ["declare"]:
                table(folder)
            case ["merge"]:
                two_recordings(folder)
            case ["lights"]:
                write_opendrive(town_world("n44"), folder / "town.xodr")
            case ["map", "get"]:
                endpoint = Endpoint([Reply(200, MAP)])
                open_until_asked.callback(endpoint.close)
                endpoint.config(folder)
            case ["secure", _]:
                begin(folder / "campaign", hosts=(), days=3, role_days=2)
            case ["sweep"]:
                small_sweep(folder, BRIEF)
            case ["standin"]:
                at = free_endpoint()
                mapping = MAPPING.format(
                    dialect="ros2dds", objects="PredictedObjects", lat=5, lon=6
                )
                (folder / "ros2.toml").write_text(f'endpoint = "{at}"\n{mapping}')
                (folder / "lot.toml").write_text(EXAMPLE)
                router = ZenohBus(BusSetup(endpoint=at), router=True)
                open_until_asked.enter_context(router)
        yield


def test_each_command_has_a_result_or_goes_on_until_it_is_ended() -> None:
    assert sorted([*ASKED, *GO_ON, *WHILE_DRIVING]) == sorted([*LEAVES, "scenarios"])
    for typed, command in COMMANDS.items():
        takes = any("--json" in option.opts for option in command.params)
        assert takes == (typed in {*ASKED, *WHILE_DRIVING}), typed
    for typed in GO_ON:
        assert "no --json" in (COMMANDS[typed].help or ""), typed


@pytest.mark.parametrize("typed", sorted(ASKED))
def test_a_result_is_json_and_stdout_holds_nothing_else(
    typed: str,
    here: dict[str, Any],
    capfd: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    folder = here["here"]
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder / "cache"))
    words = [word.format(**here).replace("+", " ") for word in ASKED[typed].split()]
    with prepared(typed, folder):
        code = run([*typed.split(), "--json", *words])
    said = capfd.readouterr()
    assert code == 0, said.err
    assert json.loads(said.out)


def test_a_drive_and_a_change_to_it_are_told_as_json(driven: ShortDrive) -> None:
    record = json.loads(driven.said)
    assert record["folder"] == str(driven.folder)
    assert record["exit"] == "completed"
    assert record["futures"]["count"] > 0
    change = json.loads(driven.change_said)
    assert change["run"] == driven.folder.name
    assert "free" in change["now"]


@pytest.mark.parametrize("how", ["--example", "--schema", "--explain=mass_kg"])
def test_all_that_config_explains_is_json_too(how: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert run(["config", how, "--json"]) == 0
    assert json.loads(capfd.readouterr().out)


@pytest.mark.parametrize(
    "asked",
    [
        ["convert", "DRIVE.mcap", "-"],
        ["declare", "DRIVE.csv", "--out", "-"],
        ["gap", "DRIVE.mcap", "--out", "-"],
        ["drive", "--out", "-"],
    ],
)
def test_a_dash_is_no_name_of_what_is_written(
    asked: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(asked) == 2
    assert " -: a name is needed" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("asked", [["runs"], ["query", "FROM runs"]])
def test_an_answer_is_json_or_csv(
    asked: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = made_run(tmp_path / "runs")

    assert run([*asked, str(folder), "--csv", "--json"]) == 2

    assert capsys.readouterr().err == "foretwin: --csv and --json: name one of them\n"


def test_words_are_lines_or_print_themselves(capsys: pytest.CaptureFixture[str]) -> None:
    print_told(CommandResult({"a": 1}, "one"), as_json=False)
    print_told(CommandResult({"a": 1}, lambda: print("two")), as_json=False)
    print_told(CommandResult({"a": 1}), as_json=False)
    assert capsys.readouterr().out == "one\ntwo\n"


def test_a_body_may_be_made_when_it_is_asked_for_and_hold_paths(
    capsys: pytest.CaptureFixture[str],
) -> None:
    print_told(CommandResult(lambda: {"a": Path("b"), "c": float("nan")}, "words"), as_json=True)
    assert json.loads(capsys.readouterr().out) == {"a": "b", "c": None}
    print_told(CommandResult(lambda: pytest.fail("made for nobody"), "words"), as_json=False)

"""Texts of strangers wherever they are shown or written: they are shown, and do nothing else.

Names of streets and of junctions, ids, the words of logs and of messages walk through every place.
"""

from __future__ import annotations

import csv
import io
import json
import re
from pathlib import Path
from typing import Any

import msgspec
import pytest
from lxml import etree

from foretwin.contracts.drive import GnssFix, RoadUser, RoadUsers
from foretwin.contracts.frames import GeoPoint
from foretwin.contracts.gap import Evidence, Verdict
from foretwin.contracts.simulation import Event, Progress, WorkerStatus
from foretwin.contracts.terminal import console, plain, visible, words
from foretwin.contracts.world import World
from foretwin.telemetry.logs import open_log
from foretwin.telemetry.logs.convert import convert
from foretwin.telemetry.logs.write_mcap import create
from foretwin.viewer.log_run import RunLog, rows_of_event
from foretwin.viewer.log_tuning import TuningLog
from foretwin.viewer.rows import in_markdown, path_part
from foretwin.world_gen.export.formats import FORMATS, ExportOptions
from tests.telemetry.drive_messages import INFO, START_NS
from tests.viewer.shown import text_of
from tests.world_gen.drawn_maps import crossing, world_of

HOSTILE = (
    "[/a] Lane", "[link](http://tracker.example) ![x](http://tracker.example/x.png)",
    "\x1b]0;title\x07\x1b[31mred\x1b[0m", "\u202egnp.exe", "a\nb\r\tc\x00d",
    "<b onload='x'>&amp;--]]>",
    '"; rm -rf /', "../../../etc/passwd", "=HYPERLINK(\"http://x\")", "+1+cmd|' /C calc'!A0",
    r"$\frac{1}{$ 50% \n", "| a | b |\n|--|", "{0} %s {name}", "/world/ego/**",
    "\ufeff\u2028東京 🚗", "x" * 3000,
)  # fmt: skip
COMMANDS = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\u2028\ufeff]")
everywhere = pytest.mark.parametrize("text", HOSTILE, ids=range(len(HOSTILE)))


def named(world: World, text: str) -> World:
    """Return a World in which all that has a name is called `text`."""

    def renamed(value: Any) -> Any:
        if isinstance(value, tuple):
            return tuple(renamed(one) for one in value)
        if not isinstance(value, msgspec.Struct):
            return value
        fields = {name: renamed(getattr(value, name)) for name in value.__struct_fields__}
        return msgspec.structs.replace(
            value, **fields | ({"name": text} if "name" in fields else {})
        )

    changed = renamed(world)
    assert {changed.intersection.name, *(lane.name for lane in changed.lanes)} == {text}
    return msgspec.structs.replace(changed, attribution=text, notes=(text,))


@everywhere
def test_a_terminal_shows_it_and_obeys_nothing(
    text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    for shown in (visible(text), plain(text), str(words(text))):
        assert not COMMANDS.search(shown)
    console().print(words(text))
    assert not COMMANDS.search(capsys.readouterr().out)


@everywhere
def test_a_view_shows_it_as_a_text(text: str) -> None:
    run, tuning = RunLog(text, text), TuningLog()
    progress = Progress(
        stamp_ns=0, drive_time_s=0.0, mission_state=text, next_intersection=text, arrival_in_s=1.0,
        futures_per_s=0.0, dropped=0, too_slow=text,
    )  # fmt: skip
    verdict = Verdict(
        vehicle_id="ego", stamp_ns=0, since_stamp_ns=0, culprit="vehicle", cause=text, text=text,
        confidence=1.0,
        evidence=(Evidence(name=text, value=0.0, std=1.0, expected=0.0, text=text),),
    )  # fmt: skip
    shown = [
        *run.static_rows(), run.first_status(), *run.progress(progress, 0),
        *tuning.verdict(verdict, 0),
    ]  # fmt: skip
    for row in shown:
        document = text_of(row.components)
        assert not COMMANDS.search(document)
        assert not re.search(r"(?<!\\)\]\(|(?<!\\)!\[|(?<!\\)<", document), "no link, no picture"
    status = WorkerStatus(stamp_ns=0, worker_id=text, state="idle", rtf=1.0, memory_mb=1.0)
    for row in run.worker(status, 0):
        assert row.path.startswith("workers/")
        assert row.path.removeprefix("workers/").count("/") == 1 + path_part(text).count("/")
    (event,) = rows_of_event(Event(stamp_ns=0, level="info", source=text, text=text), 0)
    assert not COMMANDS.search(str(event.components))
    assert "\n" not in in_markdown(text)


@pytest.fixture(scope="module")
def drawn() -> World:
    return world_of(crossing())


@pytest.mark.parametrize("name", [name for name in FORMATS if name not in ("png", "svg")])
@everywhere
def test_an_export_holds_it_and_can_be_read(
    name: str, text: str, drawn: World, tmp_path: Path
) -> None:
    world = named(drawn, text)
    path = tmp_path / f"world{FORMATS[name].suffix}"
    FORMATS[name].write(world, path, ExportOptions())
    assert {one.name.split(".")[0] for one in tmp_path.iterdir()} == {"world"}, "nothing elsewhere"
    if path.suffix == ".geojson":
        json.loads(path.read_text(encoding="utf-8"))
    else:
        tree = etree.parse(path, etree.XMLParser(resolve_entities=False))
        assert not tree.docinfo.internalDTD
        assert not tree.xpath("//@onload")


@pytest.mark.parametrize("name", ["png", "svg"])
@pytest.mark.parametrize("text", [HOSTILE[2], HOSTILE[5], HOSTILE[10]], ids=("esc", "xml", "math"))
def test_a_picture_shows_it(name: str, text: str, drawn: World, tmp_path: Path) -> None:
    path = tmp_path / f"world.{name}"
    FORMATS[name].write(named(drawn, text), path, ExportOptions())
    if name == "svg":
        assert not etree.parse(path).xpath("//@onload")


@everywhere
def test_a_recording_keeps_it_and_a_table_of_it_holds_no_formula(text: str, tmp_path: Path) -> None:
    recording, table = tmp_path / "drive.mcap", tmp_path / "drive.csv"
    info = msgspec.structs.replace(INFO, source=text)
    position = GeoPoint(50.0, 8.0)
    user = RoadUser(
        user_id=text[:64], kind="car", position=position, yaw_rad=0.0, speed_mps=1.0, length_m=4.0,
        width_m=2.0,
    )  # fmt: skip
    with create(recording, info=info) as writer:
        for number in range(5):
            stamp_ns = START_NS + number * 10**9
            writer.add("gnss", GnssFix(stamp_ns=stamp_ns, position=position))
            writer.add("objects", RoadUsers(stamp_ns=stamp_ns, users=(user,)))
    assert open_log(recording).info.source == text
    convert(recording, table, declaration=None, to=None)
    cells = [cell for row in csv.reader(io.StringIO(table.read_text())) for cell in row]
    assert all(re.fullmatch(r"[a-z_0-9]+|-?[0-9.e+-]*", cell) for cell in cells)
    assert {path.name for path in tmp_path.iterdir()} == {
        "drive.mcap",
        "drive.csv",
        "drive.csv.toml",
    }

"""Lock step: the same results whatever the number of workers, and none that knows the future."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from foretwin.orchestrator.embedded import MAP_FILE, ROUTE_FILE
from tests.system.foretwin_command import Finished, foretwin

COVERS = (
    "foretwin.__main__",
    "foretwin.orchestrator.drive.drive",
)

BERLIN_LOG = "drive-berlin-gendarmenmarkt/Berlin_Gendarmenmarkt_GT.txt"
SMALL = ("--speed", "max", "--futures", "16", "--rate", "0.5")
Drives = tuple[Finished, Finished]

pytestmark = pytest.mark.timeout(900)  # several drives each


@pytest.fixture(scope="module")
def drives(tmp_path_factory: pytest.TempPathFactory) -> Drives:
    """The same drive with one worker and with two."""
    folder = tmp_path_factory.mktemp("drives")
    one, two = (
        foretwin(
            folder / f"runs{workers}", *SMALL, "--end", "9", "--workers", str(workers),
            "--tuning", "report", *(["--trace"] if workers == 2 else []),
        )
        for workers in (1, 2)
    )  # fmt: skip
    assert (one.code, two.code) == (0, 0), one.screen + two.screen
    return one, two


def test_one_worker_and_two_give_the_same_results(drives: Drives) -> None:
    one, two = (run.record() for run in drives)
    assert one["futures"]["count"] >= 16 * 3
    assert one["futures"]["sha256"] == two["futures"]["sha256"]
    assert one["futures"]["missed_rounds"] == 0
    for table in ("comparisons", "plan_comparisons", "mirror", "gaps", "events"):
        assert drives[0].rows(table) == drives[1].rows(table)
    assert one["tuning"] == two["tuning"]
    assert one["tuning"]["gap"]["samples"] >= 6


def test_a_trace_has_all_processes_and_each_step_of_a_round(drives: Drives) -> None:
    plain, traced = (run.run for run in drives)
    assert plain is not None
    assert traced is not None
    events = json.loads((traced / "trace.json").read_bytes())["traceEvents"]
    names = {e["pid"]: e["args"]["name"] for e in events if e["name"] == "process_name"}
    assert sorted(names.values()) == [
        "builder", "mirror", "orchestrator", "recorder", "tuning", "vehicle", "viewer", "w0", "w1",
    ]  # fmt: skip
    spans = {(names[e["pid"]].rstrip("01"), e["name"]) for e in events if e["ph"] == "X"}
    assert spans >= {
        ("vehicle", "samples that are due"), ("orchestrator", "take a sample"),
        ("orchestrator", "path of a round"), ("orchestrator", "plan jobs"),
        ("orchestrator", "give jobs out"), ("w", "decode a job"), ("w", "cast"), ("w", "step"),
        ("w", "metrics"), ("w", "encode an answer"), ("orchestrator", "decode an answer"),
        ("orchestrator", "rows of a round"), ("orchestrator", "publish round"),
        ("orchestrator", "compare a round"), ("orchestrator", "write tables"),
        ("viewer", "round"), ("recorder", "write"), ("mirror", "state"), ("tuning", "tune"),
    }  # fmt: skip
    rounds = [e for e in events if e["ph"] == "b" and e["name"] == "round"]
    assert len(rounds) == drives[1].record()["futures"]["rounds"]
    assert not (plain / "trace.json").exists()
    assert not (traced / "trace").exists()


def test_a_shifted_plan_is_reported_by_its_shift(drives: Drives, tmp_path: Path) -> None:
    config = tmp_path / "shift.toml"
    config.write_text("standin_plan_shift_m = 1.0\n")
    shifted = foretwin(tmp_path / "runs", *SMALL, "--config", str(config), "--end", "9")
    assert shifted.code == 0, shifted.screen
    offset_m, shifted_m = (
        run.record()["plan_comparison"]["path_offset_m"] for run in (drives[0], shifted)
    )
    assert abs(offset_m) < 0.05
    assert abs(shifted_m - offset_m - 1.0) < 0.02


@pytest.mark.real_data
def test_cutting_the_log_changes_nothing_before_the_cut(tmp_path: Path, data_dir: Path) -> None:
    whole = data_dir / BERLIN_LOG
    cut = tmp_path / "cut.txt"
    cut_s = 43.0
    lines = whole.read_text().splitlines()
    cut.write_text("\n".join(line for line in lines if float(line.split()[1]) <= cut_s) + "\n")
    berlin = str(data_dir / "osm-berlin-mitte" / "berlin-mitte.osm")
    runs = [
        foretwin(
            tmp_path / name, *SMALL, "--map", berlin, "--log", str(log), "--start", "33",
            "--end", "45",
        )
        for name, log in (("whole", whole), ("cut", cut))
    ]  # fmt: skip
    assert [run.code for run in runs] == [0, 0], runs[0].screen + runs[1].screen
    for table in ("futures", "comparisons", "mirror"):
        full = [row for row in runs[0].rows(table) if row["stamp_ns"] < cut_s * 1e9]
        part = [row for row in runs[1].rows(table) if row["stamp_ns"] < cut_s * 1e9]
        if table == "comparisons":
            # A comparison belongs to the instant at which its horizon has passed.
            full = [r for r in full if r["stamp_ns"] / 1e9 + r["horizon_s"] < cut_s - 1.0]
            part = [r for r in part if r["stamp_ns"] / 1e9 + r["horizon_s"] < cut_s - 1.0]
        if table == "futures":
            for row in [*full, *part]:
                del row["worker_id"]
        assert full, table
        assert full == part, table


def test_a_recording_replays_to_the_same_futures(drives: Drives, tmp_path: Path) -> None:
    """What drive.mcap holds is all that the futures depend on."""
    driven, _ = drives
    assert driven.run is not None
    again = foretwin(
        tmp_path / "again", *SMALL, "--map", str(MAP_FILE), "--route", str(ROUTE_FILE),
        "--log", str(driven.run / "drive.mcap"),
    )  # fmt: skip
    assert again.code == 0, again.screen
    one, two = driven.record(), again.record()
    assert one["futures"]["count"] > 0
    assert one["futures"]["sha256"] == two["futures"]["sha256"]

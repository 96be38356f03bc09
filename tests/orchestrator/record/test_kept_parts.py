"""A run's folder within its bound: the oldest parts go, what is written and the rest stay."""

from __future__ import annotations

import os
from pathlib import Path

from foretwin.orchestrator.keep import Keep
from foretwin.orchestrator.record.kept_parts import REMOVED, KeptParts, kept_record, read_removed

NOW_S = 1_800_000_000.0
NAMES = (
    "results/futures-001.parquet",
    "drive.mcap",
    "monitor.rrd",
    "drive-002.mcap",
    "results/futures-002.parquet",
    "monitor-002.rrd",
    "drive-003.mcap",
    "results/futures.arrows",
    "results/futures.parquet",
    "run.json",
)


def run_folder(tmp_path: Path, *, size: int = 1000) -> Path:
    """Make a run whose parts ended an hour apart, the last of them now."""
    (tmp_path / "results").mkdir()
    for hours, name in enumerate(reversed(NAMES)):
        (tmp_path / name).write_bytes(bytes(size))
        os.utime(tmp_path / name, (NOW_S, NOW_S - 3600.0 * hours))
    return tmp_path


def left(folder: Path) -> set[str]:
    return {name for name in NAMES if (folder / name).exists()}


def test_what_is_older_than_is_kept_goes_and_is_counted(tmp_path: Path) -> None:
    folder = run_folder(tmp_path)
    kept = KeptParts(folder, Keep(hours=6.5), utc_s=lambda: NOW_S)
    kept.look()
    kept.look()
    assert left(folder) == set(NAMES[3:])
    assert {
        name: (gone.parts, gone.size_bytes) for name, gone in kept.gone.items()
    } == dict.fromkeys(("futures.parquet", "drive.mcap", "monitor.rrd"), (1, 1000))
    assert kept.gone["drive.mcap"].until == "2027-01-15T00:00:00Z"
    assert read_removed(folder) == kept.gone
    assert kept_record(folder, "6.5h")["removed"]["monitor.rrd"]["parts"] == 1
    assert KeptParts(folder, Keep()).gone == kept.gone, "an orchestrator that comes back goes on"


def test_a_size_bounds_the_whole_folder(tmp_path: Path) -> None:
    folder = run_folder(tmp_path)
    KeptParts(folder, Keep(total_bytes=7_500), utc_s=lambda: NOW_S).look()
    assert left(folder) == set(NAMES[3:])


def test_what_is_being_written_stays_however_little_is_kept(tmp_path: Path) -> None:
    folder = run_folder(tmp_path)
    KeptParts(folder, Keep(total_bytes=1.0), utc_s=lambda: NOW_S).look()
    assert left(folder) == {
        "drive-003.mcap", "monitor-002.rrd", "results/futures.arrows", "results/futures.parquet",
        "run.json",
    }  # fmt: skip


def test_without_a_bound_nothing_goes(tmp_path: Path) -> None:
    folder = run_folder(tmp_path)
    KeptParts(folder, Keep(), utc_s=lambda: NOW_S + 1e9).look()
    assert left(folder) == set(NAMES)
    assert kept_record(folder, None) == {"bound": None, "removed": {}}
    (folder / REMOVED).write_text("{")
    assert read_removed(folder) == {}

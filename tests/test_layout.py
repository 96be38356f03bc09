"""The house: whose names are whose, who knows whom, how long a file may be, what is not written."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ROOMS = (
    "contracts", "geometry", "telemetry", "world_gen", "sim_worker", "orchestrator", "viewer",
)  # fmt: skip
LIMIT_LINES = 300
CODE = (".py", ".js", ".css", ".html", ".j2", ".cc")

MACHINE_PATH = re.compile(r"(?<![\w.~-])/(?:work|root|home)(?=/|\b)")
INDEX_ADDRESS = re.compile(r"pypi" + r"\.org|pythonhosted|index-url|simple/\s*$", re.MULTILINE)
HEAVY = (
    "mujoco", "rerun", "numpy", "numba", "zenoh", "pyarrow", "matplotlib", "scipy", "osmium",
)  # fmt: skip


def tracked_files() -> list[Path]:
    listed = subprocess.run(
        ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    if listed.returncode != 0:
        pytest.skip("not a git checkout: no list of the project's files")
    return [ROOT / name for name in listed.stdout.split("\0") if name and (ROOT / name).is_file()]


def texts() -> list[tuple[str, str]]:
    found = []
    for path in tracked_files():
        data = path.read_bytes()
        if b"\0" not in data and path != Path(__file__):
            found.append((str(path.relative_to(ROOT)), data.decode("utf-8")))
    return found


def test_every_room_is_reached_by_its_one_name() -> None:
    linked = {room: (ROOT / "foretwin" / room).resolve() for room in ROOMS}

    assert linked == {room: ROOT / room for room in ROOMS}


def test_no_room_is_imported_by_another_name() -> None:
    bare = re.compile(rf"^\s*(?:import|from) (?:{'|'.join(ROOMS)})\b", re.MULTILINE)

    assert [name for name, text in texts() if name.endswith(".py") and bare.search(text)] == []


def test_rooms_import_only_what_the_table_allows() -> None:
    checked = subprocess.run(
        [Path(sys.executable).parent / "lint-imports"], cwd=ROOT, capture_output=True, text=True,
        check=False,
    )  # fmt: skip

    assert checked.returncode == 0, checked.stdout


def test_zenoh_is_known_to_the_bus_alone() -> None:
    importing = re.compile(r"^\s*(?:import|from) zenoh\b", re.MULTILINE)
    rooms = [(name, text) for name, text in texts() if name.split("/")[0] in ROOMS]

    assert [name for name, text in rooms if importing.search(text)] == [
        "contracts/bus.py",
        "contracts/router.py",
        "contracts/zenoh_config.py",
    ]


def test_files_of_code_stay_readable() -> None:
    lengths = {name: text.count("\n") for name, text in texts() if name.endswith(CODE)}

    assert {name: n for name, n in lengths.items() if n > LIMIT_LINES} == {}


def test_metres_of_a_degree_are_said_once() -> None:
    said = re.compile(r"\b111_?\d{3}\b|\b6_?37[18]_?\d{3}\b")
    rooms = [(name, text) for name, text in texts() if name.split("/")[0] in ROOMS]

    found = [name for name, text in rooms if name.endswith(".py") and said.search(text)]
    assert found == ["contracts/frames.py"]


def test_no_file_is_named_after_nothing() -> None:
    nameless = {"utils", "util", "common", "helpers", "helper", "manager", "misc"}
    names = [path.relative_to(ROOT) for path in tracked_files()]

    assert [str(n) for n in names if nameless & {*n.parts[:-1], n.stem}] == []


def test_no_file_holds_a_machine_path_or_an_index_address() -> None:
    found = [
        f"{name}: {match.group()}"
        for name, text in texts()
        for pattern in (MACHINE_PATH, INDEX_ADDRESS)
        for match in pattern.finditer(text)
    ]

    assert found == []


def loaded_by(module: str) -> set[str]:
    """Return what is loaded once a module is."""
    code = f"import sys, {module}; print(*sys.modules)"
    run = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    return set(run.stdout.split())


def test_the_command_line_starts_without_heavy_libraries() -> None:
    assert loaded_by("foretwin.__main__") & set(HEAVY) == set()


def test_who_leads_a_drive_loads_no_engine_and_no_viewer() -> None:
    loaded = loaded_by("foretwin.orchestrator.drive.drive")
    assert loaded & {"mujoco", "rerun", "matplotlib", "scipy.stats"} == set()


def test_who_holds_a_sweep_loads_nothing_that_only_its_workers_need() -> None:
    loaded = loaded_by("foretwin.orchestrator.commands.sweep")
    assert loaded & {"numba", "mujoco", "scipy.stats", "rerun", "matplotlib"} == set()

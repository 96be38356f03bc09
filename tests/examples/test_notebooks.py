"""The example notebooks hold no outputs, and run as they stand."""

from __future__ import annotations

from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

from foretwin.orchestrator.commands.sweep import run_sweep
from foretwin.orchestrator.sweep.spec import load_spec
from tests.orchestrator.sweeps import alone, small_sweep
from tests.system.foretwin_command import foretwin

NOTEBOOKS = Path(__file__).parents[2] / "examples" / "notebook"
ALL = {path.stem for path in NOTEBOOKS.glob("*.ipynb")}


def test_there_is_one_for_each_use_and_none_holds_outputs() -> None:
    assert {"drive", "sweep", "identification", "world"} == ALL
    for name in ALL:
        cells = read(name).cells
        assert [cell for cell in cells if cell.get("outputs") or cell.get("execution_count")] == []


def read(name: str) -> nbformat.NotebookNode:
    return nbformat.read(NOTEBOOKS / f"{name}.ipynb", as_version=4)


def pictures(name: str, folder: Path) -> int:
    """Run a notebook in a folder; returns how many pictures it shows."""
    told = read(name)
    NotebookClient(told, timeout=300, resources={"metadata": {"path": str(folder)}}).execute()
    outputs = [one for cell in told.cells for one in cell.get("outputs", ())]
    assert [one for one in outputs if one.get("name") == "stderr"] == []
    return sum("image/png" in one.get("data", {}) for one in outputs)


@pytest.mark.judge
def test_a_world_is_drawn_with_its_futures(tmp_path: Path) -> None:
    assert pictures("world", tmp_path) == 2


@pytest.mark.judge
def test_a_sweep_is_looked_into(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    loaded = load_spec(small_sweep(tmp_path))
    run_sweep(loaded, tmp_path / "out", alone(loaded))
    monkeypatch.setenv("SWEEP", str(tmp_path / "out"))

    assert pictures("sweep", tmp_path) == 2


@pytest.mark.judge
def test_a_drive_is_looked_into(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    driven = foretwin(tmp_path / "driven", "--speed", "max", "--end", "20", "--futures", "16")
    monkeypatch.setenv("RUN", str(driven.run))

    assert pictures("drive", tmp_path) == 3
    assert pictures("identification", tmp_path) == 1

"""The wheel holds what the rooms need at run time, and works when installed alone."""

from __future__ import annotations

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ROOMS = (
    "contracts", "geometry", "telemetry", "world_gen", "sim_worker", "orchestrator", "viewer",
)  # fmt: skip
DATA_SUFFIXES = (".toml", ".osm", ".geojson", ".xml", ".json", ".msg", ".j2", ".css", ".js")
PAGE_SUFFIXES = (".html", ".svg")

pytestmark = pytest.mark.judge


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    subprocess.run(
        [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "-w", folder, ROOT],
        check=True,
    )
    (built,) = folder.glob("foretwin-*.whl")
    return built


def test_wheel_holds_every_module_and_data_file(wheel: Path) -> None:
    held = set(zipfile.ZipFile(wheel).namelist())
    needed = {
        f"foretwin/{path.relative_to(ROOT)}"
        for room in ROOMS
        for path in (ROOT / room).rglob("*")
        if path.suffix in (*DATA_SUFFIXES, *PAGE_SUFFIXES, ".py")
    }

    assert needed - held == set()
    assert "foretwin/orchestrator/embedded/drawn_town.osm" in held
    assert {"foretwin/__init__.py", "foretwin/__main__.py", "foretwin/py.typed"} <= held
    assert {name.split("/")[0].partition("-")[0] for name in held} == {"foretwin"}
    assert any(name.endswith("licenses/LICENSE") for name in held)


def test_wheel_installed_alone_finds_its_embedded_map(wheel: Path, tmp_path: Path) -> None:
    venv = tmp_path / "venv"
    subprocess.run([sys.executable, "-m", "venv", venv], check=True)
    python = venv / "bin" / "python"
    subprocess.run([python, "-m", "pip", "install", "--quiet", "--no-deps", wheel], check=True)
    code = (
        "from foretwin.orchestrator.embedded import MAP_FILE, ROUTE_FILE;"
        "print(MAP_FILE.is_file(), ROUTE_FILE.is_file(), MAP_FILE)"
    )

    said = subprocess.run(
        [python, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True
    ).stdout.split()

    assert said[:2] == ["True", "True"]
    assert Path(said[2]).is_relative_to(venv)

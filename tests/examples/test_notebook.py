"""The notebook examples run as they stand."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from foretwin.orchestrator.embedded import MAP_FILE

EXAMPLES = Path(__file__).parents[2] / "examples" / "notebook"


def example(name: str, *arguments: object) -> str:
    done = subprocess.run(
        [sys.executable, EXAMPLES / name, *map(str, arguments)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_ten_lines_lead_from_a_map_to_plotted_futures(tmp_path: Path) -> None:
    example("futures_at_a_junction.py", MAP_FILE, tmp_path / "futures.png")

    assert (tmp_path / "futures.png").read_bytes().startswith(b"\x89PNG")


def test_worlds_are_exported_in_a_loop(tmp_path: Path) -> None:
    said = example("export_worlds.py", MAP_FILE, tmp_path, ".geojson")

    assert len(said.splitlines()) == len(list(tmp_path.glob("*.geojson"))) > 1

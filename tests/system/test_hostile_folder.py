"""foretwin runs in any folder: what lies there is neither executed nor written to."""

from __future__ import annotations

import socket
import subprocess
import sys
from pathlib import Path

import pytest

from foretwin.contracts.ports import LOOPBACK
from tests.system.foretwin_command import environment, foretwin

MODULES = ("telemetry", "contracts", "orchestrator", "viewer", "numpy", "zenoh", "foretwin")
SHORT = ("--speed", "max", "--end", "3", "--futures", "4", "--workers", "1")
SNARE = (
    "import pathlib; pathlib.Path(__file__).with_suffix('.sprung').touch(); raise SystemExit(9)\n"
)


@pytest.fixture
def hostile(tmp_path: Path) -> Path:
    folder = tmp_path / "hostile"
    folder.mkdir()
    for name in MODULES:
        (folder / f"{name}.py").write_text(SNARE, encoding="utf-8")
    return folder


def test_modules_in_the_working_directory_are_not_executed(hostile: Path) -> None:
    done = foretwin(hostile / "runs", *SHORT)

    assert done.code == 0, done.screen
    assert done.record()["exit"] == "completed"
    assert list(hostile.glob("*.sprung")) == []


def test_the_snare_works(hostile: Path) -> None:
    sprung = subprocess.run([sys.executable, "-c", "import telemetry"], cwd=hostile, check=False)

    assert sprung.returncode == 9
    assert (hostile / "telemetry.sprung").exists()


def test_a_drive_from_a_read_only_folder_writes_where_it_is_told(tmp_path: Path) -> None:
    folder, out = tmp_path / "read_only", tmp_path / "elsewhere"
    folder.mkdir(mode=0o555)
    arguments = ["drive", "--view", "none", "--out", str(out), "--tuning", "off", *SHORT]
    done = subprocess.run(
        [sys.executable, "-P", "-m", "foretwin", *arguments],
        cwd=folder, env=environment(tmp_path / "cache"), capture_output=True, text=True,
        timeout=280, check=False,
    )  # fmt: skip

    assert done.returncode == 0, done.stderr
    assert list(folder.iterdir()) == []


def test_a_port_that_is_taken_is_said_in_a_line_and_leaves_nothing(tmp_path: Path) -> None:
    with socket.create_server((LOOPBACK, 0)) as other:
        port = other.getsockname()[1]
        config = tmp_path / "drive.toml"
        config.write_text(
            f'endpoint = "tcp/{LOOPBACK}:{port}"\ninsecure = true\n', encoding="utf-8"
        )
        arguments = ["drive", "--view", "none", "--out", str(tmp_path / "new" / "runs")]
        done = subprocess.run(
            [sys.executable, "-P", "-m", "foretwin", *arguments, "--config", str(config), *SHORT],
            env=environment(tmp_path / "cache"), capture_output=True, text=True, timeout=280,
            check=False,
        )  # fmt: skip

    assert (done.returncode, done.stdout) == (2, "")
    assert f"port {port} is taken" in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert not (tmp_path / "new").exists()

"""foretwin runs in any folder: what lies there is neither executed nor written to."""

from __future__ import annotations

import socket
import subprocess
import sys
from pathlib import Path

import pytest

from foretwin.contracts.ports import LOOPBACK
from tests.system.foretwin_command import environment

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


def test_a_drive_in_a_read_only_folder_executes_nothing_of_it_and_writes_where_it_is_told(
    hostile: Path, tmp_path: Path
) -> None:
    there, out = set(hostile.iterdir()), tmp_path / "elsewhere"
    hostile.chmod(0o555)
    arguments = ["drive", "--view", "none", "--out", str(out), "--tuning", "off", *SHORT]
    done = subprocess.run(
        [sys.executable, "-P", "-m", "foretwin", *arguments],
        cwd=hostile, env=environment(tmp_path / "cache"), capture_output=True, text=True,
        timeout=280, check=False,
    )  # fmt: skip

    assert done.returncode == 0, done.stderr
    assert set(hostile.iterdir()) == there


def test_the_snare_works(hostile: Path) -> None:
    sprung = subprocess.run([sys.executable, "-c", "import telemetry"], cwd=hostile, check=False)

    assert sprung.returncode == 9
    assert (hostile / "telemetry.sprung").exists()


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
    assert done.stderr == (
        f"foretwin: endpoint tcp/{LOOPBACK}:{port}: port {port} is taken; "
        "end what listens on it, or give another one\n"
    )
    assert not (tmp_path / "new").exists()

"""Workers of machines that are not as the drive's own: what they would do otherwise is said in one
line, and nothing is lost of what they had."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest

from foretwin.contracts.ports import free_endpoint
from tests.system.foretwin_command import environment, started, wait_for
from tests.system.test_balance import ledger_of, record_of
from tests.system.test_faults import LIVE, assert_nothing_left, says, under_way

pytestmark = [pytest.mark.judge, pytest.mark.timeout(600)]

ENDS_WITHIN_S = 240.0
WIDE = "X86_V4"
"""What numpy calls a processor with AVX-512."""


def disabled() -> str:
    """Return those of numpy's features beyond AVX2 that this processor has; skips without any."""
    from numpy._core._multiarray_umath import __cpu_features__ as features

    if not features.get(WIDE, False):
        pytest.skip("numpy computes with nothing here that could be switched off")
    return " ".join(one for one in (WIDE, "AVX512_ICL", "AVX512_SPR") if features.get(one, False))


def other_version(folder: Path) -> Path:
    """Return a folder on whose path foretwin is of another version."""
    info = folder / "other" / "foretwin-9.9.9.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: foretwin\nVersion: 9.9.9\n")
    return info.parent


class Party:
    """A drive, and workers that join it from this machine as if from others."""

    def __init__(self, folder: Path, run: Path, endpoint: str, stack: contextlib.ExitStack) -> None:
        self.folder, self.run, self._endpoint, self._stack = folder, run, endpoint, stack

    def join(self, name: str, *, prefix: Sequence[str] = (), **env: str) -> subprocess.Popen[str]:
        command = [
            *prefix, sys.executable, "-P", "-m", "foretwin", "worker", "--connect", self._endpoint,
            "--insecure", "--name", name, "--workers", "1", "--cache", str(self.folder / name),
        ]  # fmt: skip
        process = subprocess.Popen(
            command, cwd=self.folder, env=environment(self.folder / "cache") | env, text=True,
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL,
        )  # fmt: skip
        self._stack.callback(_killed, process)
        return process

    def says(self, text: str) -> bool:
        return says(self.run, text)

    def plays_along(self, name: str) -> None:
        wait_for(lambda: self.says(f"w-{name}-0 plays along: "), f"{name} to join")


def _killed(process: subprocess.Popen[str]) -> None:
    process.kill()
    process.communicate()


def ended(process: subprocess.Popen[str]) -> tuple[int, list[str]]:
    """Return the exit code of a worker's command, and what its screen says beside its joining."""
    screen, _ = process.communicate(timeout=ENDS_WITHIN_S)
    lines = [line for line in screen.splitlines() if " joins run " not in f" {line}"]
    return process.returncode, lines


@contextmanager
def party(folder: Path) -> Iterator[Party]:
    """Give a drive that is under way; ended, it has lost nothing."""
    out, endpoint = folder / "runs", free_endpoint()
    with (
        started(out, *LIVE, "--endpoint", endpoint, "--insecure") as process,
        contextlib.ExitStack() as stack,
    ):
        yield Party(folder, run := under_way(out), endpoint, stack)
        process.send_signal(signal.SIGINT)
        screen, _ = process.communicate(timeout=ENDS_WITHIN_S)
    assert process.returncode == 130, screen
    record, ledger = record_of(run), ledger_of(run)
    assert record["dropped"]["given_up_rounds"] == 0
    assert ledger.jobs.refused == 0
    assert_nothing_left(run)


def test_another_processors_features_give_the_same_bits_or_no_work(tmp_path: Path) -> None:
    narrow = disabled()
    with party(tmp_path) as drive:
        other = drive.join("narrow", NPY_DISABLE_CPU_FEATURES=narrow)
        generic = drive.join("generic", NUMBA_CPU_NAME="generic")
        code, (line,) = ended(other)
        drive.plays_along("generic")
        generic.send_signal(signal.SIGTERM)
        assert ended(generic) == (0, [])

    assert code == 2
    assert "narrow computes other bits than this machine (" in line
    assert f"NPY_DISABLE_CPU_FEATURES={narrow}" in line
    far = {one["worker"]: one for one in record_of(drive.run)["workers"]["far"]}
    assert far["w-narrow-0"]["refused"] in line
    assert "refused" not in far["w-generic-0"]


def test_another_version_is_named_and_gets_no_work(tmp_path: Path) -> None:
    paths = os.pathsep.join([str(other_version(tmp_path)), environment(tmp_path)["PYTHONPATH"]])
    with party(tmp_path) as drive:
        code, lines = ended(drive.join("old", PYTHONPATH=paths))

    assert code == 2
    (line,) = lines
    assert "old runs foretwin 9.9.9, this drive " in line
    assert line.endswith(": install the same")


def test_on_a_full_disk_a_worker_plays_along_and_says_so_once(tmp_path: Path) -> None:
    if os.geteuid() != 0:
        pytest.skip("a disk of its own needs root")
    cache = tmp_path / "full"
    cache.mkdir()
    mount = f'mount -t tmpfs -o size=4k none "{cache}" && exec "$@"'
    with party(tmp_path) as drive:
        worker = drive.join("full", prefix=("unshare", "-m", "sh", "-c", mount, "sh"))
        drive.plays_along("full")
        worker.send_signal(signal.SIGTERM)
        code, lines = ended(worker)

    assert code == 3
    (line,) = lines
    assert line.endswith("full: no space left on device; Worlds are fetched again each time")

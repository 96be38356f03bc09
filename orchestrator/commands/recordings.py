"""The commands that look at recordings: `convert` and `view`."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from foretwin.contracts.errors import UserError
from foretwin.contracts.segments import first_left
from foretwin.contracts.terminal import say


def convert_log(
    source: Path, target: Path, *, to: str | None = None, declaration: Path | None = None
) -> None:
    """Convert a recorded drive and say what was kept and what was not.

    `to` is one of foretwin.telemetry.logs.convert.TARGETS, else the target's suffix tells.
    """
    from foretwin.telemetry.logs.convert import TARGETS, convert

    kind = next((one for one in TARGETS if one == to), None)
    if to is not None and kind is None:
        raise UserError(f"--to {to}: no kind of target; known: {', '.join(TARGETS)}")
    if not source.exists():
        raise FileNotFoundError(f"recorded drive {source}: no such file or folder")
    if not target.parent.is_dir():
        raise UserError(f"{target}: folder {target.parent} does not exist")
    report = convert(source, target, declaration=declaration, to=kind)
    kept = ", ".join(f"{count} {name}" for name, count in sorted(report.counts.items()))
    say(f"{target}: {kept}")
    if report.skipped:
        left = ", ".join(f"{count} {reason}" for reason, count in sorted(report.skipped.items()))
        say(f"left out: {left}")


def open_view(run_folder: Path) -> int:
    """Open a run's recording in the native viewer; returns the viewer's exit code."""
    recording = first_left(run_folder / "monitor.rrd") if run_folder.is_dir() else run_folder
    if not recording.is_file():
        raise FileNotFoundError(f"{run_folder}: holds no monitor.rrd")
    return subprocess.run(
        [sys.executable, "-P", "-m", "foretwin.viewer", "--open", str(recording)], check=False
    ).returncode

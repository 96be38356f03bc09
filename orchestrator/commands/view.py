"""`foretwin view`: the recording of a run in a window or a browser."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from foretwin.contracts.layout import read_layout
from foretwin.contracts.segments import MONITOR_FILE, first_left
from foretwin.orchestrator.record.which_run import run_folder


def open_view(run: Path, *, out: Path, layout: str | None, view: str) -> int:
    """Show a run, or a recording of Rerun, in its own layout or the one that is asked for.

    Returns the viewer's exit code.

    Raises UserError or FileNotFoundError, in one line, where there is nothing to be shown.
    """
    if layout is not None:
        read_layout(layout)
    recording = run if run.is_file() else first_left(run_folder(run, out) / MONITOR_FILE)
    if not recording.is_file():
        raise FileNotFoundError(f"{recording.parent}: holds no monitor.rrd")
    asked = ["--open", str(recording), "--view", view]
    asked += [] if layout is None else ["--layout", layout]
    return subprocess.run(
        [sys.executable, "-P", "-m", "foretwin.viewer", *asked], check=False
    ).returncode

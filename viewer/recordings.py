"""Recordings as files: whether they are complete, and copies with another layout."""

from __future__ import annotations

import subprocess
import warnings
from pathlib import Path

import rerun.blueprint as rrb
from rerun.chunk import RrdReader

from foretwin.viewer.live_viewer import offline_environment, rerun_program
from foretwin.viewer.sinks import FLUSH_S, recording_stream

MEND_S = 120.0


def is_complete(recording: Path) -> bool:
    """Return whether `recording` was closed in order: a killed viewer leaves no footer."""
    try:
        _reader(recording).store()
    except Exception:  # the reader raises what its Rust side makes of it
        return False
    return True


def copy_with_blueprint(recording: Path, copy: Path, blueprint: rrb.Blueprint) -> None:
    """Write `recording`, complete or cut off anywhere, to `copy` with another layout.

    Raises ValueError for a file that is no recording.
    """
    try:
        reader = _reader(recording)
        stores = reader.recordings()
    except Exception:  # cut off within a message
        reader = _reader(_mended(recording, copy.with_suffix(".mended.rrd")))
        stores = reader.recordings()
    if not stores:
        raise ValueError(f"{recording} is no Rerun recording")
    stream = recording_stream(stores[0].recording_id, send_properties=False)
    stream.save(copy, default_blueprint=blueprint)
    stream.send_chunks(reader.stream())
    stream.flush(timeout_sec=10.0 * FLUSH_S)
    stream.disconnect()


def _reader(recording: Path) -> RrdReader:
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="RRD file has no footer")
        return RrdReader(recording)


def _mended(recording: Path, mended: Path) -> Path:
    """Write all whole messages of `recording` to `mended` and return it."""
    merge = subprocess.run(
        [rerun_program(), "rrd", "merge", "--continue-on-error", recording, "-o", mended],
        capture_output=True,
        env=offline_environment(),
        timeout=MEND_S,
        check=False,
    )
    if merge.returncode != 0 or not mended.is_file() or mended.stat().st_size == 0:
        raise ValueError(f"{recording} is no Rerun recording")
    return mended

"""Shows recordings that are there: in a window, or served for a browser."""

from __future__ import annotations

import os
from pathlib import Path

from foretwin.contracts.layout import read_layout
from foretwin.contracts.owned_folder import make_temporary
from foretwin.contracts.segments import first_left, first_name, segments_of
from foretwin.viewer.blueprint import DEFAULT, drive_blueprint
from foretwin.viewer.live_viewer import (
    HOST,
    NoViewerError,
    has_display,
    offline_environment,
    rerun_program,
    serve_recordings,
)
from foretwin.viewer.recordings import copy_with_blueprint, is_complete


def show(recording: Path, *, layout: str | None = None, view: str = "native") -> None:
    """Become the native viewer of `recording` and of its later parts, or serve it for a browser.

    Without a `layout` it is shown in its own.

    Raises FileNotFoundError, NoViewerError or UserError, in one line.
    """
    if not recording.is_file():
        raise FileNotFoundError(f"no recording {recording}")
    if view == "native" and not has_display():
        raise NoViewerError(
            f"no display to show {recording} on; --view web serves it for a browser, "
            f"`python -m foretwin.viewer.picture {recording} OUT.png` renders a picture"
        )
    program = str(rerun_program())
    first = first_name(recording)
    parts = segments_of(first) if first_left(first) == recording else [recording]
    parts = [_laid_out(part, layout) for part in parts]
    if view == "web":
        serve_recordings(parts)
        return
    arguments = [program, "--bind", HOST, "--port", "auto", *map(str, parts)]
    os.execve(program, arguments, offline_environment())


def _laid_out(recording: Path, layout: str | None) -> Path:
    """Return a recording with this layout: a copy, but where it is complete and keeps its own."""
    if layout is None and is_complete(recording):
        return recording
    owned = make_temporary("foretwin-shown-")
    owned.keep_over_exec()  # the next one to be shown finds whether this one still is
    copy = owned.path / recording.name
    copy_with_blueprint(recording, copy, drive_blueprint(read_layout(layout or DEFAULT)))
    return copy

"""Pictures without a display: `python -m foretwin.viewer.picture RRD OUT.png --at 39`."""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np
from rerun.experimental import ViewerClient

from foretwin.contracts.layout import VIEWS, Layout, read_layout
from foretwin.contracts.owned_folder import temporary_folder
from foretwin.contracts.ports import free_port
from foretwin.contracts.terminal import say
from foretwin.viewer.blueprint import DEFAULT, drive_blueprint
from foretwin.viewer.live_viewer import NoViewerError, address, start_program, wait_until_it_answers
from foretwin.viewer.recordings import copy_with_blueprint
from foretwin.viewer.rows import TIMELINE

SETTLE_S = 60.0
POLL_S = 0.25
SIZE = (1600, 1000)


class Picture(NamedTuple):
    """The whole window as PNG, and each visible view by its name."""

    window: bytes
    views: dict[str, bytes]


def has_vulkan() -> bool:
    """Return whether there is a Vulkan driver, which the headless viewer needs.

    Where the environment names drivers, Vulkan's loader looks for no others.
    """
    named = os.environ.get("VK_DRIVER_FILES") or os.environ.get("VK_ICD_FILENAMES")
    if named:
        return any(Path(one).exists() for one in named.split(os.pathsep))
    folders = [Path(root) / "vulkan/icd.d" for root in ("/usr/share", "/usr/local/share", "/etc")]
    return any(any(folder.glob("*.json")) for folder in folders if folder.is_dir())


def take_picture(
    recording: Path,
    *,
    at_s: float | None = None,
    layout: Layout | None = None,
    size: tuple[int, int] = SIZE,
) -> Picture:
    """Render `recording` at drive time `at_s` (None: its end) in a layout of today.

    Raises FileNotFoundError without the file, NoViewerError where nothing can be rendered.
    """
    if not recording.is_file():
        raise FileNotFoundError(f"no recording {recording}")
    if sys.platform.startswith("linux") and not has_vulkan():
        raise NoViewerError("no Vulkan driver to render with; on Debian: mesa-vulkan-drivers")
    with temporary_folder("foretwin-picture-") as folder:
        # The viewer renames what it opens, so a layout sent apart would never meet it.
        copy = folder / "recording.rrd"
        copy_with_blueprint(recording, copy, drive_blueprint(layout))
        port = free_port()
        window = f"{size[0]}x{size[1]}"
        program = start_program(
            "--headless", "--hide-welcome-screen", "--window-size", window, port=port
        )
        try:
            wait_until_it_answers(program, port)
            client = ViewerClient.connect(address(port))
            client.open(str(copy))
            return _settled(client, at_s)
        finally:
            _end(program)


def _settled(client: ViewerClient, at_s: float | None) -> Picture:
    """Move the time cursor and wait until everything is loaded and two windows look the same."""
    deadline_s = time.monotonic() + SETTLE_S
    last = b""
    placed = False
    while time.monotonic() < deadline_s:
        state = client.get_state()
        timelines = [t for rec in state.recordings for t in rec.timelines if t.name == TIMELINE]
        ends = [t.end for t in timelines if t.end is not None]
        if state.loading or not ends or state.active_recording is None:
            time.sleep(POLL_S)
            continue
        if not placed:
            moment_ns = max(ends) if at_s is None else round(at_s * 1e9)
            client.set_time(TIMELINE, duration=np.timedelta64(moment_ns, "ns"), play_state="paused")
            placed = True
            continue
        window = client.take_screenshot()
        if window == last:
            return Picture(window, _views(client))
        last = window
        time.sleep(POLL_S)
    raise NoViewerError(f"the picture did not settle within {SETTLE_S:.0f} s")


def _views(client: ViewerClient) -> dict[str, bytes]:
    """Return a picture of each view that is on screen; those behind a tab have none."""
    views: dict[str, bytes] = {}
    for view in client.get_state().views:
        try:
            views[view.name] = client.take_screenshot(view.view_id)
        except ConnectionError as problem:
            if "not found" not in str(problem):
                raise
    return views


def _end(program: subprocess.Popen[bytes]) -> None:
    program.terminate()
    try:
        program.wait(5.0)
    except subprocess.TimeoutExpired:
        program.kill()
        program.wait()


def main(arguments: list[str] | None = None) -> int:
    """Write one picture; returns the exit code."""
    parser = argparse.ArgumentParser(prog="python -m foretwin.viewer.picture", description=__doc__)
    parser.add_argument("recording", type=Path, metavar="RRD")
    parser.add_argument("out", type=Path, metavar="OUT.png")
    parser.add_argument("--at", type=float, metavar="S", help="drive time; default: the end")
    parser.add_argument("--layout", default=DEFAULT, help="drive, identify, gap, sweep or a file")
    parser.add_argument(
        "--show", action="append", default=[], choices=VIEWS, metavar="VIEW", help="open this tab"
    )
    parser.add_argument("--size", metavar="WxH", default=f"{SIZE[0]}x{SIZE[1]}")
    given = parser.parse_args(arguments)
    try:
        width, height = (int(part) for part in given.size.split("x"))
        picture = take_picture(
            given.recording,
            at_s=given.at,
            layout=read_layout(given.layout).opened_at(*given.show),
            size=(width, height),
        )
        given.out.write_bytes(picture.window)
    except (OSError, ValueError) as problem:
        say(f"foretwin.viewer.picture: {problem}", error=True)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())

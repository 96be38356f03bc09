"""Shows again what the display of a run showed, at the pace of its drive or at one instant."""

from __future__ import annotations

import secrets
import threading
import time
from pathlib import Path

import msgspec

from foretwin.contracts.codec import read_message
from foretwin.contracts.errors import UserError
from foretwin.contracts.page_address import FRAMES_FILE, page_address
from foretwin.contracts.ports import LOOPBACK
from foretwin.contracts.setup import CopilotSetup, read_setup
from foretwin.contracts.terminal import say
from foretwin.contracts.world import World
from foretwin.viewer.copilot.frames_file import KeptFrames
from foretwin.viewer.copilot.junction_plan import junction_plan
from foretwin.viewer.copilot.server import (
    CannotError,
    CopilotServer,
    MarkAsked,
    PageActions,
    page_app,
)

FRAME_S = 0.1
AGAIN_S = 3.0
"""So long the last frame stays before all begins again."""
LEAVE_S = 0.5
SETUP_FILE = Path("processes") / "copilot.json"


class ReplayedRun:
    """The frames of a run's folder, with its Worlds; raises UserError where it has none."""

    def __init__(self, folder: Path) -> None:
        self.frames = KeptFrames(folder / FRAMES_FILE)
        try:
            setup = read_setup(folder / SETUP_FILE, CopilotSetup)
        except (OSError, msgspec.DecodeError) as problem:
            raise UserError(f"{folder / SETUP_FILE}: cannot be read: {problem}") from problem
        self._worlds, self._drive_frame = folder / "worlds", setup.drive_frame
        self._known = {one.world_id for one in self.frames.frames}
        self.about = {
            "run": setup.run_id,
            "seat": "replay",
            "vehicle": setup.vehicle_id,
            "attribution": setup.attribution,
        }
        self._begun_s = time.monotonic()

    @property
    def actions(self) -> PageActions:
        """What pages may ask for."""
        return PageActions(frame_at=self.frame_at, plan_of=self.plan_of, mark=self._mark)

    def frame_at(self, drive_s: float | None) -> bytes:
        """Return the frame of a drive time, or the one whose turn it is."""
        at_s = self.turn_s(time.monotonic()) if drive_s is None else drive_s
        return msgspec.json.encode(self.frames.at(at_s))

    def turn_s(self, now_s: float) -> float:
        """Return the drive time that is shown at a time: from begin to end, then again."""
        lasts_s = self.frames.ends_s - self.frames.begins_s + AGAIN_S
        return self.frames.begins_s + (now_s - self._begun_s) % lasts_s

    def plan_of(self, world_id: str) -> bytes | None:
        """Return the plan of a World that the frames name, None where there is none."""
        if world_id not in self._known:
            return None
        try:
            world = read_message(self._worlds / f"{world_id}.world", World)
        except (OSError, ValueError):
            return None
        return msgspec.json.encode(junction_plan(world, self._drive_frame))

    @staticmethod
    def _mark(asked: MarkAsked) -> None:
        raise CannotError("this is a replay: what is over cannot be marked")


def replay(folder: Path, port: int, ended: threading.Event) -> None:
    """Serve a run's frames on this machine until `ended`; says where."""
    run, key = ReplayedRun(folder), secrets.token_hex(8)
    server = CopilotServer(
        lambda feed: page_app(key, feed, run.actions, about=run.about), host=LOOPBACK, port=port
    )
    server.start()
    span = f"{run.frames.begins_s:.0f} to {run.frames.ends_s:.0f} s"
    say(f"co-pilot display: {page_address(key, port=port)} ({span} of the drive; ?at=SECONDS)")
    while not ended.wait(FRAME_S):
        server.publish(run.frame_at(None))
    server.close(LEAVE_S)

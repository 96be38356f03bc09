"""What those are started with who watch a drive: recorder, viewer and co-pilot display."""

from __future__ import annotations

from typing import Any

from foretwin.contracts.layout import read_layout
from foretwin.contracts.page_address import FRAMES_FILE, page_address, page_key
from foretwin.contracts.ports import LOOPBACK
from foretwin.contracts.process_setup import BusSetup
from foretwin.contracts.segments import MONITOR_FILE
from foretwin.contracts.setup import CopilotSetup, RecorderSetup, ViewerSetup
from foretwin.orchestrator.plan import DrivePlan

RECORDER, VIEWER, COPILOT = "recorder", "viewer", "copilot"
WATCHERS = VIEWER, COPILOT
"""Who shows a drive."""


def recorder_setup(plan: DrivePlan, base: dict[str, Any]) -> RecorderSetup:
    """Return how the process is set that keeps what the vehicle sends."""
    return RecorderSetup(
        **base,
        file=str(plan.recording),
        roll=plan.keep.recordings,
    )


def viewer_setup(plan: DrivePlan, base: dict[str, Any]) -> ViewerSetup:
    """Return how the process is set that writes and shows what Rerun shows."""
    return ViewerSetup(
        **base,
        file=str(plan.folder / MONITOR_FILE),
        roll=plan.keep.view,
        worlds_dir=str(plan.worlds_dir),
        drive_frame=plan.drive_frame,
        live=plan.live_view,
        page_port=plan.page_port,
        layout=read_layout(plan.config.layout),
        roads=str(plan.roads_file),
        anchor=plan.lot,
        fence=() if plan.anchor is None else plan.anchor.fence,
        title=f"foretwin {plan.run_id}",
        attribution=plan.osm.attribution,
        start_stamp_ns=plan.start_stamp_ns,
    )


def copilot_setup(plan: DrivePlan, base: dict[str, Any]) -> CopilotSetup:
    """Return how the process is set that serves the co-pilot display, on this machine alone."""
    assert plan.copilot_port is not None
    return CopilotSetup(
        **base,
        port=plan.copilot_port,
        worlds_dir=str(plan.worlds_dir),
        drive_frame=plan.drive_frame,
        attribution=plan.osm.attribution,
        start_stamp_ns=plan.start_stamp_ns,
        operator=None if plan.local is None else plan.local.setup_of("operator"),
        frames_file=str(plan.folder / FRAMES_FILE),
    )


def copilot_address(plan: DrivePlan, bus: BusSetup) -> str | None:
    """Return where the co-pilot display that joins by `bus` is opened, None where there is none.

    Raises OSError where what it shows on the bus cannot be read.
    """
    if plan.copilot_port is None:
        return None
    return page_address(page_key(bus, plan.run_id), port=plan.copilot_port)


def addresses(plan: DrivePlan, bus: BusSetup) -> list[str]:
    """Return the lines that say where a drive is looked at; the co-pilot display joins by `bus`."""
    lines = [f"view http://{LOOPBACK}:{plan.page_port}/"] if plan.live_view == "web" else []
    if (address := copilot_address(plan, bus)) is not None:
        lines.append(f"co-pilot display: {address}")
    return lines

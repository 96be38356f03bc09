"""Takes back what a drive in lock step has written: it is played again from its start."""

from __future__ import annotations

from foretwin.orchestrator.plan import DrivePlan
from foretwin.orchestrator.record.run_state import RESULTS

_WRITTEN = (
    f"{RESULTS}/*",
    "drive*.mcap*",
    "drive*.tally*",
    "so_far.json*",
    "monitor*.rrd*",
    "processes/*.stderr",
)
"""What processes and tables begin; Worlds and parameters are named by what they hold, and stay."""


def forget_results(plan: DrivePlan) -> None:
    """Remove what was recorded and found; its processes must have ended. Raises OSError."""
    for pattern in _WRITTEN:
        for file in plan.folder.glob(pattern):
            file.unlink()

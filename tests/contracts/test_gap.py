"""What a gap may lose before it is an alarm, as docs/gap.md says."""

from __future__ import annotations

from foretwin.contracts.gap import ALARM_HORIZON_S, ALARM_LIMITS_PER_S
from tests.test_layout import ROOT


def test_the_page_tells_the_limits() -> None:
    page = " ".join((ROOT / "docs" / "gap.md").read_text(encoding="utf-8").split())
    along, across, yaw, speed = (
        ALARM_LIMITS_PER_S[name] for name in ("along_m", "across_m", "yaw_rad", "speed_mps")
    )
    assert (
        f"An alarm is raised when, after {ALARM_HORIZON_S:g} s, two runs in a row lose more per "
        f"second than {along:g} m along, {across:g} m across, {yaw:g} rad or {speed:g} m/s"
    ) in page
    assert len(ALARM_LIMITS_PER_S) == 4

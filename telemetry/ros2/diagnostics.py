"""Levels of /foretwin/diagnostics: the newest of each kind, and the gateway's own counts."""

from __future__ import annotations

from collections.abc import Mapping

from foretwin.contracts.gap import GapAlarm, Verdict
from foretwin.contracts.simulation import Event
from foretwin.telemetry.ros2.outwards import Level
from foretwin.telemetry.ros2.safety import VehicleGate


class DiagnosticLevels:
    """Keeps the last warning, alarm of each quantity, and verdict."""

    def __init__(self) -> None:
        self._levels: dict[str, Level] = {}

    def take(self, message: Event | GapAlarm | Verdict) -> None:
        """Take a message of the run; events that only inform are passed over."""
        match message:
            case Event(level="info"):
                pass
            case Event() as event:
                level = 2 if event.level == "error" else 1
                self._levels["event"] = Level("foretwin/event", level, event.text, {})
            case GapAlarm() as alarm:
                name = f"foretwin/gap/{alarm.quantity}"
                values = {"value": f"{alarm.value:.6g}", "limit": f"{alarm.limit:.6g}"}
                text = "beyond its limit" if alarm.over else "within its limit"
                self._levels[name] = Level(name, int(alarm.over), text, values)
            case Verdict() as verdict:
                values = {"cause": verdict.cause, "confidence": f"{verdict.confidence:.3f}"}
                self._levels["verdict"] = Level("foretwin/verdict", 1, verdict.text, values)

    def levels(self, report: Mapping[str, Mapping[str, int]], *, gate: VehicleGate) -> list[Level]:
        """Return all lines; counts of a part where none should be are a warning."""
        levels = list(self._levels.values())
        for part, counts in report.items():
            well = part in ("in", "sent", "gate") or not any(counts.values())
            values = {key: str(value) for key, value in counts.items()}
            levels.append(Level(f"foretwin/ros2/{part}", 0 if well else 1, "", values))
        shut = gate.state == "shut"
        levels.append(Level("foretwin/ros2/towards_vehicle", 2 * shut, gate.why, {}))
        return levels

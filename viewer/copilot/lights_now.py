"""Lights as the display knows them: what is heard of them, and what the drive goes by."""

from __future__ import annotations

from foretwin.contracts.drive import SignalColour, SignalState
from foretwin.contracts.lights import ShownLight, ShownLights
from foretwin.contracts.terminal import plain
from foretwin.contracts.too_old import LIGHT_FOR_S
from foretwin.viewer.copilot.frame import AheadLight


class LightsNow:
    """Keeps the newest word on each group of lights."""

    def __init__(self) -> None:
        self._heard: dict[str, SignalState] = {}
        self._shown: dict[str, ShownLight] = {}

    def take_heard(self, one: SignalState) -> None:
        """Take a colour that the car hears."""
        self._heard[one.group_id] = one

    def take_shown(self, shown: ShownLights) -> None:
        """Take what all lights of the World in force show."""
        self._shown = {one.group_id: one for one in shown.lights}

    def colours(self, stamp_ns: int) -> dict[str, str]:
        """Return by group, in words, the colours that are heard or set by hand."""
        found = {
            group: _words(one.colour)
            for group, one in self._heard.items()
            if abs(stamp_ns - one.stamp_ns) <= LIGHT_FOR_S * 1e9 and one.colour != "unknown"
        }
        for group, light in self._shown.items():
            if light.why == "set":
                found[group] = _words(light.colour)
        return found

    def of(self, group_id: str | None) -> AheadLight | None:
        """Return what a group shows, by plan too; None where that is not known."""
        one = None if group_id is None else self._shown.get(group_id)
        if one is None:
            return None
        return AheadLight(group=plain(one.group_id), colour=_words(one.colour), why=one.why)


def _words(colour: SignalColour) -> str:
    return colour.replace("_", " and ")

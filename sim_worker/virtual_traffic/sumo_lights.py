"""SUMO's traffic lights on a network of our own export, set to what the World's lights show.

netconvert keeps in each program which signal of the OpenDRIVE file every link obeys, and the file's
controllers name the World's groups of these signals. Letters are those of SUMO's link states.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

from foretwin.contracts.drive import SignalColour

_LETTERS: dict[SignalColour, str] = {
    # Dark and unknown lights leave the signs in force: whoever waits there gives way.
    "red": "r", "amber": "y", "red_amber": "u", "dark": "o", "unknown": "o",
}  # fmt: skip
_OWN_PROGRAM = "0"


class _Junction(NamedTuple):
    """The links of a traffic light: their groups, and the letters of their green."""

    groups: tuple[str | None, ...]
    greens: str


def groups_of_signals(network: Path) -> dict[str, str]:
    """Return the World's group of each signal of an OpenDRIVE file of ours, by its id there."""
    root = ElementTree.parse(network).getroot()
    return {
        control.attrib["signalId"]: controller.attrib["name"]
        for controller in root.iterfind("controller")
        for control in controller.iterfind("control")
    }


class SumoLights:
    """The traffic lights of a simulation that runs; those without a known group stay SUMO's own."""

    def __init__(self, sumo: Any, group_of: Mapping[str, str]) -> None:
        self._lights = sumo.trafficlight
        self._junctions: dict[str, _Junction] = {}
        self._set: dict[str, str] = {}
        """What was set, by traffic light; the others follow their own programs."""
        for name in self._lights.getIDList():
            phases = self._lights.getAllProgramLogics(name)[0].phases
            links = range(len(phases[0].state))
            signals = (self._lights.getParameter(name, f"linkSignalID:{link}") for link in links)
            groups = tuple(group_of.get(signal) for signal in signals)
            # A link that gives way at green does so at every green.
            greens = "".join(
                "g" if any(one.state[link] == "g" for one in phases) else "G" for link in links
            )
            if any(groups):
                self._junctions[name] = _Junction(groups, greens)

    def show(self, colours: Mapping[str, SignalColour]) -> None:
        """Let the lights show these colours of groups in the coming step.

        A traffic light of which no group is told any more goes back to its own program.
        """
        for name, junction in self._junctions.items():
            if not any(group in colours for group in junction.groups):
                if self._set.pop(name, None) is not None:
                    self._lights.setProgram(name, _OWN_PROGRAM)
                continue
            state = "".join(
                "o" if group is None else _letter(colours.get(group, "unknown"), green)
                for group, green in zip(junction.groups, junction.greens, strict=True)
            )
            if self._set.get(name) != state:
                self._lights.setRedYellowGreenState(name, state)
                self._set[name] = state


def _letter(colour: SignalColour, green: str) -> str:
    return green if colour == "green" else _LETTERS[colour]

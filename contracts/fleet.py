"""Workers on other machines: what they are called, and how one joins a drive and is measured.

A worker says that it is there (its liveliness token), is told in one question with what the drive
plays, plays the drive's probe futures, and is told whether it may. It shares no path with the
drive: Worlds come by their ids.
"""

from __future__ import annotations

import msgspec

from foretwin.contracts.vehicle import VehicleParameters

FAR = "w-"
"""How the processes of workers on other machines begin: w-NAME-0, w-NAME-1, …"""
MOST_CLOCK_OFFSET_S = 0.5
"""A machine whose clock is farther off may not join: Zenoh's hybrid clock (uhlc, its
UHLC_MAX_DELTA_MS) takes no stamp from farther ahead, and certificates are held against it."""


class MachineInfo(msgspec.Struct, frozen=True, kw_only=True):
    """What decides the bits that a machine computes, and how much of it there is."""

    cores: int
    cpu: str
    """Its processor, and what of it is switched off."""
    versions: dict[str, str]
    arithmetic: dict[str, str]
    """What numpy's functions come to there, see foretwin.contracts.arithmetic."""


class EnlistRequest(msgspec.Struct, frozen=True, kw_only=True):
    """With what a drive plays: all that a worker of its own is started with."""

    vehicle: VehicleParameters
    version: int
    """Of the vehicle's parameters."""
    foretwin: str
    """The version of the drive's program."""
    planners: tuple[str, ...] = ()
    simulations: int = 32
    kept_worlds: int = 8
    control_hz: float = 20.0


class Enlisted(msgspec.Struct, frozen=True, kw_only=True):
    """What a worker says of itself; `instance` is a word of its own for as long as it lives."""

    instance: str
    machine: MachineInfo


class Admittance(msgspec.Struct, frozen=True, kw_only=True):
    """Whether a worker may play along: `refused` says why not. The answer is the same."""

    refused: str = ""


class ClockQuestion(msgspec.Struct, frozen=True, kw_only=True):
    """What time is it there?"""


class ClockAnswer(msgspec.Struct, frozen=True, kw_only=True):
    """The answering machine's clock, UTC."""

    utc_ns: int


class WorldQuestion(msgspec.Struct, frozen=True, kw_only=True):
    """Asks for a World of the drive by its id, which is the hash of its content."""

    world_id: str


class WorldBytes(msgspec.Struct, frozen=True, kw_only=True):
    """A World's file; who asked checks it by its id."""

    data: bytes


def is_far(process_id: str) -> bool:
    """Whether a process is a worker on another machine."""
    return process_id.startswith(FAR)


def far_id(machine: str, number: int | str) -> str:
    """Return what a worker on a machine is called in a drive."""
    return f"{FAR}{machine}-{number}"


def machine_of(worker_id: str) -> str:
    """Return the name of the machine of `far_id`."""
    return worker_id.removeprefix(FAR).rsplit("-", 1)[0]

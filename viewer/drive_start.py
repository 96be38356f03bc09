"""When a drive began, for who may join it late: drive time counts from there in every view."""

from __future__ import annotations

import logging

from foretwin.contracts.bus import Bus, ask
from foretwin.contracts.drive import InfoRequest

INFO_S = 2.0
"""How long the vehicle may take to say when its drive began, where the setup does not."""

_log = logging.getLogger(__name__)


def start_of_drive(bus: Bus, vehicle: str, *, told_ns: int, first_stamp_ns: int) -> int:
    """Return the stamp of a drive's start: what the setup has told, else what the vehicle says.

    The first stamp that was seen where it does not answer.
    """
    if told_ns:
        return told_ns
    try:
        info = ask(bus, "info", InfoRequest(), timeout_s=INFO_S, vehicle=vehicle)
    except TimeoutError as problem:
        _log.warning("drive time counts from the first stamp: %s", problem)
        return first_stamp_ns
    return int(info.start_stamp_ns)

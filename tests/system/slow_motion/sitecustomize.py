"""Lets an interpreter's clocks go slower than the world's, from its first import on.

An interpreter that finds this folder in PYTHONPATH, and SLOW_MOTION in its environment, measures
time by a clock of its own: `pace` seconds of it a second. All of one environment have the same
clock, so that nobody among them can tell, but for how much the processor does between two ticks.
Deadlines of the processes and the drive's time go by it, and the leases that we give Zenoh; what
else is not Python's, such as the handshakes of TLS, goes by the world's.
"""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable


def go_slowly(pace: float, since_mono_ns: int) -> None:
    """Replace the clocks of `time`: from an instant of the monotonic clock on they go at `pace`."""

    def slowed(clock_ns: Callable[[], int], since_ns: int) -> Callable[[], int]:
        return lambda: since_ns + round((clock_ns() - since_ns) * pace)

    sleep, to_utc_ns = time.sleep, time.time_ns() - time.monotonic_ns()
    utc_ns = slowed(time.time_ns, since_mono_ns + to_utc_ns)
    mono_ns = slowed(time.monotonic_ns, since_mono_ns)
    time.time_ns, time.time = utc_ns, lambda: utc_ns() / 1e9
    for name in ("monotonic", "perf_counter"):  # on Linux one clock
        setattr(time, f"{name}_ns", mono_ns)
        setattr(time, name, lambda: mono_ns() / 1e9)
    time.sleep = lambda seconds: sleep(seconds / pace)


def hold_longer(pace: float) -> None:
    """Let links of ours be taken for cut, and be looked for, after as long by the slow clock."""
    with contextlib.suppress(ImportError):  # an interpreter of somebody else's
        from foretwin.contracts import zenoh_config

        zenoh_config.LEASE_MS = round(zenoh_config.LEASE_MS / pace)
        zenoh_config.CONNECT_S /= pace


if "SLOW_MOTION" in os.environ:
    _pace, _since = os.environ["SLOW_MOTION"].split("@")
    go_slowly(float(_pace), int(_since))
    hold_longer(float(_pace))

"""The wall clock of a drive's host, as its processes read it: it can be set."""

from __future__ import annotations

import mmap
import random
import struct
from pathlib import Path

CLOCK = "FORETWIN_CHAOS_CLOCK"
"""In the environment of what a drive starts: the file that says by how much the clock is off."""
STEPS_S = (0.2, -0.2, 2.0, -2.0, 30.0, -30.0, 3600.0, -3600.0)


class HostClock:
    """A file of eight bytes that a drive's processes look at; see injected/sitecustomize.py."""

    def __init__(self, file: Path) -> None:
        self.file = file
        file.write_bytes(struct.pack("q", 0))
        with file.open("r+b") as opened:
            self._held = mmap.mmap(opened.fileno(), 8)
        self.offset_ns = 0

    def set(self, strength: float) -> str:
        """Set it, by how much `strength` says; returns that in words."""
        step_s = random.Random(strength).choice(STEPS_S)
        self.offset_ns += round(1e9 * step_s)
        self._held[:] = struct.pack("q", self.offset_ns)
        return f"by {step_s:g} s"

    def close(self) -> None:
        """Leave the file alone."""
        self._held.close()

"""What virtual receivers and inertial sensors say, apart from what the car itself says."""

from __future__ import annotations

from foretwin.contracts.drive import GnssFix, ImuSample


class SensedFix(GnssFix, frozen=True, kw_only=True):
    """A position that a virtual receiver measures."""

    sensor: str = ""


class SensedImu(ImuSample, frozen=True, kw_only=True):
    """What a virtual inertial sensor measures, in its own axes."""

    sensor: str = ""

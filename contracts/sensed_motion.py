"""What virtual receivers and inertial sensors say, apart from what the car itself says."""

from __future__ import annotations

from foretwin.contracts.drive import GnssFix, ImuSample


class SensedFix(GnssFix, frozen=True, kw_only=True):
    """A position that a virtual receiver measures; `std_m` is of its whole error."""

    up_std_m: float = 0.0
    """One standard deviation of its height."""
    sensor: str = ""


class SensedImu(ImuSample, frozen=True, kw_only=True):
    """What a virtual inertial sensor measures, in its own axes."""

    sensor: str = ""

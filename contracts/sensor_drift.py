"""Errors of sensors: white noise, and what wanders: Gauss-Markov processes and random walks.

The one model of them, for the stand-in car and for sensor files. White noise, a bias that is
correlated for a while and one that walks are the terms that IMUs are commonly described by.
"""

from __future__ import annotations

import math

import msgspec
import numpy as np

from foretwin.contracts.arrays import Array


class Drift(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How an error wanders, in the unit of what is measured; by itself not at all."""

    std: float = 0.0
    """Of a first-order Gauss-Markov process, once it has gone on for long."""
    time_s: float = 100.0
    """Its correlation time: what is left of an error then is 1/e of it."""
    walk_per_sqrt_s: float = 0.0
    """Of a random walk: its standard deviation after one second."""

    def __post_init__(self) -> None:
        """Raise ValueError for what is no drift."""
        sizes = (self.std, self.time_s, self.walk_per_sqrt_s)
        if not all(math.isfinite(one) and one >= 0.0 for one in sizes) or not self.time_s:
            raise ValueError("a drift's numbers are finite and not negative, time_s above 0")


class DriftingError:
    """One error of several axes, which begins as if it had gone on for long; a walk begins at 0.

    Steps are exact for any spacing of stamps: what is left of the Gauss-Markov part after dt is
    exp(-dt / time_s), and its variance stays (Gillespie, 1996, Exact numerical simulation of the
    Ornstein-Uhlenbeck process and its integral). Nothing is drawn for a part that is 0.
    """

    def __init__(self, drift: Drift, axes: int, random: np.random.Generator) -> None:
        self._drift, self._random = drift, random
        self._markov, self._walk = np.zeros(axes), np.zeros(axes)
        self._stamp_ns: int | None = None

    def at(self, stamp_ns: int) -> Array:
        """Return the error (axes,) at a stamp; stamps that do not advance leave it as it is."""
        drift, last_ns = self._drift, self._stamp_ns
        if last_ns is not None:
            stamp_ns = max(stamp_ns, last_ns)
        dt_s = math.inf if last_ns is None else (stamp_ns - last_ns) * 1e-9
        if drift.std:
            left = math.exp(-dt_s / drift.time_s)
            new = self._random.normal(0.0, drift.std, len(self._markov))
            self._markov = left * self._markov + math.sqrt(1.0 - left**2) * new
        if drift.walk_per_sqrt_s and last_ns is not None:
            size = drift.walk_per_sqrt_s * math.sqrt(dt_s)
            self._walk = self._walk + self._random.normal(0.0, size, len(self._walk))
        self._stamp_ns = stamp_ns
        return self._markov + self._walk


class NoisyError:
    """White noise and a drift together, of several axes."""

    def __init__(
        self, std: float, drift: Drift, axes: int, *, white: np.random.Generator,
        wandering: np.random.Generator,
    ) -> None:  # fmt: skip
        self._std, self._axes, self._white = std, axes, white
        self._drift = DriftingError(drift, axes, wandering)

    def at(self, stamp_ns: int) -> Array:
        """Return the error (axes,) at a stamp."""
        return self._white.normal(0.0, self._std, self._axes) + self._drift.at(stamp_ns)

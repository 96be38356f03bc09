"""The step of the physics, also for those who must know it and step nothing."""

from __future__ import annotations

TIMESTEP_S = 0.01

"""Gymnasium environments over the stage on which futures are simulated.

Importing this registers `foretwin/Junction-v0`; it needs the extra `foretwin[gym]`.
"""

from __future__ import annotations

from foretwin.sim_worker.gym.env import JunctionEnv
from foretwin.sim_worker.gym.registration import register
from foretwin.sim_worker.gym.vector_env import JunctionVectorEnv

__all__ = ["JunctionEnv", "JunctionVectorEnv"]

register()

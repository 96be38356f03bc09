"""Gymnasium environments over the stage on which futures are simulated.

Importing this registers `foretwin/Junction-v0`; it needs the extra `foretwin[gym]`.
"""

from __future__ import annotations

import gymnasium

from foretwin.sim_worker.gym.env import JunctionEnv
from foretwin.sim_worker.gym.vector_env import JunctionVectorEnv

__all__ = ["ID", "JunctionEnv", "JunctionVectorEnv"]

ID = "foretwin/Junction-v0"

if ID not in gymnasium.registry:
    gymnasium.register(
        id=ID,
        entry_point=f"{__name__}.env:JunctionEnv",
        vector_entry_point=f"{__name__}.vector_env:JunctionVectorEnv",
    )

"""Makes `gymnasium.make` and `gymnasium.make_vec` know the environments of foretwin."""

from __future__ import annotations

import gymnasium

ID = "foretwin/Junction-v0"
_MODULE = "foretwin.sim_worker.gym"


def register() -> None:
    """Register the environment, once."""
    if ID not in gymnasium.registry:
        gymnasium.register(
            id=ID,
            entry_point=f"{_MODULE}.env:JunctionEnv",
            vector_entry_point=f"{_MODULE}.vector_env:JunctionVectorEnv",
        )

"""The physics of a stage's cars: in the open by themselves, near something static with all of it.

A car that can touch nothing needs no collisions, constraints or sensors, and the model of it alone
no sleeping geoms: a step in the open costs the same in any World, and three quarters of one on bare
ground. Both models have the same state, so that cars go from one to the other between ticks, and
their motion is the same to the bit.
"""

from __future__ import annotations

import mujoco
import numpy as np
from mujoco import batch as mujoco_batch

from foretwin.contracts.arrays import Array, Flags, Indices
from foretwin.contracts.vehicle import VehicleParameters
from foretwin.sim_worker.batch.model import STATIC_CONTACT, compile_open

_EXPANDED = ("actuator_delay", "actuator_biasprm", "actuator_forcerange")


class Physics:
    """`nsim` cars; `qpos`, `qvel`, `ctrl`, `history` and what is per car of the model are live.

    `motion` (nsim, nq + nv) holds `qpos` and `qvel` side by side.
    """

    def __init__(
        self, model: mujoco.MjModel, vehicle: VehicleParameters, *, nsim: int, threads: int
    ) -> None:
        """`model` is that of the World with the vehicle in it."""
        self._open = mujoco_batch.Batch(compile_open(vehicle), nsim, nthread=threads)
        self._among = mujoco_batch.Batch(model, nsim, nthread=threads, persistent=True)
        self.qpos, self.qvel = self._open.bind("qpos"), self._open.bind("qvel")
        first = mujoco.mj_stateSize(model, int(mujoco.mjtState.mjSTATE_TIME))
        self.motion = self._open.state[:, first : first + model.nq + model.nv]
        self.ctrl, self.history = self._open.bind("ctrl"), self._open.bind("history")
        self._fields = [(self._open.expand(f), self._among.expand(f)) for f in _EXPANDED]
        self.delay, self.biasprm, self.forcerange = (here for here, _ in self._fields)
        self._been_among = np.zeros(nsim, dtype=bool)
        self._sensor = int(model.sensor(STATIC_CONTACT).adr[0])
        self._control_spec = int(mujoco.mjtState.mjSTATE_CTRL)

    def reset(self, rows: Indices) -> None:
        """Forget all that cars did before."""
        self._open.reset(ids=rows, stage=mujoco.mjtStage.mjSTAGE_NONE)
        if self._been_among[rows].any():
            self._among.reset(ids=rows, stage=mujoco.mjtStage.mjSTAGE_NONE)
            self._been_among[rows] = False

    def advance(self, controls: Array, rows: Indices | None) -> None:
        """Step the cars `rows` (K,), or all, in the open; `controls` are (K, steps, nu)."""
        self._open.rollout(
            controls.shape[1],
            control=controls,
            control_spec=self._control_spec,
            record=(),
            ids=rows,
        )

    def advance_among(self, controls: Array, rows: Indices) -> Flags:
        """Step the cars `rows` (K,) among all that stands around; return (K,) who touched it."""
        self._been_among[rows] = True
        self._among.state[rows] = self._open.state[rows]
        for here, there in self._fields:
            there[rows] = here[rows]
        seen = self._among.rollout(
            controls.shape[1],
            control=controls,
            control_spec=self._control_spec,
            record=("sensordata",),
            ids=rows,
        )
        self._open.state[rows] = self._among.state[rows]
        return np.asarray((seen["sensordata"][:, :, self._sensor] > 0.0).any(axis=1))

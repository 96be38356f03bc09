"""Warnings of MuJoCo reach the log, and no file."""

from __future__ import annotations

import logging
from pathlib import Path

import mujoco
import numpy as np
import pytest

from foretwin.sim_worker.vehicle.mujoco_log import log_mujoco_warnings

FALLING = "<mujoco><worldbody><body><freejoint/><geom size='.1'/></body></worldbody></mujoco>"


def test_a_warning_is_logged_in_place_of_a_file(
    caplog: pytest.LogCaptureFixture, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    log_mujoco_warnings()
    model = mujoco.MjModel.from_xml_string(FALLING)
    data = mujoco.MjData(model)
    data.qvel[:] = np.nan
    with caplog.at_level(logging.WARNING, logger="mujoco"):
        mujoco.mj_step(model, data)
    assert any("Nan" in record.getMessage() for record in caplog.records)
    assert list(tmp_path.iterdir()) == []

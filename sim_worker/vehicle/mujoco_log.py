"""Sends MuJoCo's warnings to the process's log instead of a file in the working directory."""

from __future__ import annotations

import logging

import mujoco

_log = logging.getLogger("mujoco")


def log_mujoco_warnings() -> None:
    """Install the handler; without it MuJoCo writes MUJOCO_LOG.TXT wherever the process runs."""
    mujoco.set_mju_user_warning(_warn)


def _warn(text: str) -> None:
    _log.warning("%s", text)

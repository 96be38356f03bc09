"""The spaces of the environments, and how their settings are given."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeAlias, cast

import numpy as np
import numpy.typing as npt
from gymnasium.spaces import Box, Space

from foretwin.sim_worker.gym.course import Course, Source

Floats: TypeAlias = Space[npt.NDArray[np.float32]]


def observation_space(course: Course) -> Floats:
    """Return the space of one observation."""
    return cast(Floats, Box(-1.0, 1.0, (len(course.features),), np.float32))


def action_space(course: Course) -> Floats:
    """Return the space of one action."""
    return cast(Floats, Box(-1.0, 1.0, (course.action_size,), np.float32))


def split_settings(settings: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the settings of a `Source`, and the others, which are those of a `Course`."""
    of_source = {name: value for name, value in settings.items() if name in Source._fields}
    return of_source, {name: v for name, v in settings.items() if name not in of_source}

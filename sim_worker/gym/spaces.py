"""The spaces of the environments, and how their settings are given."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Any, TypeAlias, cast

import numpy as np
import numpy.typing as npt
from gymnasium.spaces import Box, Space

from foretwin.contracts.errors import UserError
from foretwin.contracts.world import World
from foretwin.sim_worker.gym.course import Course
from foretwin.sim_worker.gym.episodes import Source

Floats: TypeAlias = Space[npt.NDArray[np.float32]]


def observation_space(course: Course) -> Floats:
    """Return the space of one observation."""
    return cast(Floats, Box(-1.0, 1.0, (len(course.features),), np.float32))


def action_space(course: Course) -> Floats:
    """Return the space of one action."""
    return cast(Floats, Box(-1.0, 1.0, (course.action_size,), np.float32))


def course_of(
    world: World | str | Path, settings: dict[str, Any], *, count: int, render_mode: str | None
) -> Course:
    """Return the course of an environment, whose settings are those of `Source` and of `Course`.

    Raises UserError for settings or a render mode that do not fit.
    """
    if render_mode not in (None, "rgb_array"):
        raise UserError(f"render_mode {render_mode!r} is not rgb_array")
    of_course = (*inspect.signature(Course.__init__).parameters,)
    known = (*Source._fields[1:], *of_course[of_course.index("count") + 1 :])
    for name in settings:
        if name not in known:
            raise UserError(f"unknown setting {name!r}; known: {', '.join(known)}")
    of_source = {name: settings.pop(name) for name in Source._fields if name in settings}
    return Course(Source(world, **of_source), count=count, **settings)

"""A plan and a drive are compared by the ways that they led, not by how they stood."""

from __future__ import annotations

import numpy as np
import pytest

from foretwin.contracts.arrays import Array
from foretwin.sim_worker.analysis.side_by_side.departure import Limits, departure, way_kind


def test_who_trembles_on_the_spot_has_driven_no_farther() -> None:
    """A stop whose positions jump to and fro by 15 cm: a plan beyond it is not compared."""
    x_m = np.append(np.arange(0.0, 8.0, 0.5), 7.5 - 0.15 * (np.arange(24) % 2))
    still = np.zeros_like(x_m)
    driven = np.column_stack([x_m, still, still, still])
    ahead_m = np.linspace(0.0, 12.0, len(x_m))
    turned = np.maximum(ahead_m - 8.0, 0.0)
    planned = np.column_stack([ahead_m, turned, still, still])
    assert departure(planned, driven).lateral_m == pytest.approx(0.0, abs=0.01)


def going(speed_mps: float, *, left_m: float = 0.0) -> Array:
    """4 s straight on, beside the axis."""
    time_s = np.arange(0.0, 4.01, 0.1)
    still = np.zeros_like(time_s)
    return np.column_stack([speed_mps * time_s, still + left_m, still, still + speed_mps])


def test_ways_that_hardly_begin_are_not_known_to_lie_on_each_other() -> None:
    """Nor to lie beside each other: a plan that stands 3 m aside says nothing of its lane."""
    for planned, driven in (
        (going(0.0), going(0.0)),
        (going(0.0, left_m=3.0), going(10.0)),
        (going(0.5, left_m=3.0), going(0.5)),
    ):
        found = departure(planned, driven)
        assert (found.lateral_m, found.turned_rad) == (None, None)
        assert way_kind(found, Limits()) is None
    assert departure(going(0.0), going(10.0)).along_m == pytest.approx(-40.0)

"""Futures as an engineer reads them, instead of ids and factors."""

from __future__ import annotations

import pytest

from foretwin.contracts.futures import Future
from foretwin.orchestrator.rounds.future_titles import NOMINAL, future_title

TITLES = {"scp": "Straight crossing paths", "latency": "Late perception"}


@pytest.mark.parametrize(
    ("future", "title"),
    [
        (Future(index=0, name="nominal"), NOMINAL),
        (Future(index=3, name="of a sweep"), "of a sweep"),
        (
            Future(
                index=1,
                name="scp +1.63 s, speed x1.10",
                numbers={"target_speed_factor": 1.1},
                scenario_id="scp",
                values={"crossing.speed_mps": 8.0, "crossing.arrives_after_s": 1.63},
            ),
            "Straight crossing paths, 1.6 s later, car 10 % faster",
        ),
        (
            Future(
                index=2,
                name="scp -0.33 s, speed x0.80",
                numbers={"target_speed_factor": 0.8},
                scenario_id="scp",
                values={"crossing.arrives_after_s": -0.33},
            ),
            "Straight crossing paths, 0.3 s earlier, car 20 % slower",
        ),
        (
            Future(
                index=2,
                name="latency +1.00 s, speed x1.00",
                numbers={"target_speed_factor": 1.0},
                scenario_id="latency",
                values={"lead.arrives_after_s": 0.04},
            ),
            "Late perception",
        ),
        (
            Future(
                index=4,
                name="mixed",
                numbers={
                    "friction_factor": 0.6,
                    "extra_steering_delay_s": 0.2,
                    "lateral_shift_m": -0.5,
                },
            ),
            "grip 60 %, steering 0.2 s late, 0.5 m to the right",
        ),
        (
            Future(index=5, name="shift", numbers={"lateral_shift_m": 0.5}),
            "0.5 m to the left",
        ),
        (Future(index=6, name="own", scenario_id="mine"), "mine"),
    ],
)
def test_a_future_says_what_happens_in_it(future: Future, title: str) -> None:
    assert future_title(future, TITLES) == title

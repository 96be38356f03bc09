"""A worker and a car on another machine are heard again soon after their link is back."""

from __future__ import annotations

import contextlib
import os
import statistics
from pathlib import Path

import pytest

from tests.starvation import kept_waiting
from tests.system.far_cuts import FarLink


@pytest.mark.judge
@pytest.mark.timeout(280)
@pytest.mark.parametrize("car", [False, True], ids=["worker", "car"])
def test_who_was_cut_off_is_heard_soon_after_the_link_is_back(tmp_path: Path, car: bool) -> None:
    with contextlib.ExitStack() as stack:
        try:
            far = stack.enter_context(FarLink(tmp_path, car=car))
        except OSError as error:
            pytest.skip(f"no networks of their own here: {error}")
        with kept_waiting(*far.pids) as kept:
            # TCP calls once a second: where in it the link is back differs.
            heard = [far.cut(5.0 + 0.1 * number) for number in range(10)]
    print([(round(one.token_s, 2), round(one.answer_s, 2)) for one in heard], os.getloadavg())
    assert statistics.median(one.answer_s for one in heard) < 0.4 + kept.seconds / len(heard)
    assert max(one.answer_s for one in heard) < 0.7 + kept.seconds

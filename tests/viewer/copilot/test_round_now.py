"""How old the round is that is shown: by the state that it began with, and never for younger."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from foretwin.contracts.simulation import ActiveWorld
from foretwin.viewer.copilot.round_now import OLD_ROUND_S
from foretwin.viewer.danger import ROUND_FOR_S
from tests.viewer.copilot.test_now import Drive, a_round
from tests.viewer.scene import WORLD_ID, state_at


def test_a_round_ages_and_is_gone_when_none_follows() -> None:
    drive = Drive()
    drive.goes_on(4.0)
    drive.take("round", a_round())
    drive.goes_on(5.5)
    aged = drive.frame()
    assert aged.danger is not None
    assert aged.danger.in_s == 0.5
    assert aged.round_for_s == pytest.approx(ROUND_FOR_S - 1.5)
    drive.goes_on(4.1 + ROUND_FOR_S)
    gone = drive.frame()
    assert (gone.danger, gone.level, gone.nominal) == (None, "none", [])
    assert (gone.round_age_s, gone.round_for_s, gone.round_old) == (None, None, False)
    assert "no futures now" in gone.sentence


def test_a_round_is_as_old_as_the_state_that_it_began_with_whenever_it_comes() -> None:
    drive = Drive()
    drive.goes_on(6.0)
    drive.take("round", a_round(5.0))
    fresh = drive.frame()
    assert (fresh.round_age_s, fresh.round_old) == (pytest.approx(1.0), False)
    assert fresh.danger is not None
    assert fresh.danger.in_s == pytest.approx(1.0), "of two seconds from that state"
    drive.take("round", a_round(6.0 - OLD_ROUND_S - 0.1))
    old = drive.frame()
    assert (old.round_old, old.level) == (True, "danger")
    assert "greatest danger 2 s ago: car" in old.sentence
    drive.take("round", a_round(6.0 - ROUND_FOR_S - 0.1))
    assert (drive.frame().danger, drive.frame().level) == (None, "none")


def test_a_round_ages_while_no_state_comes() -> None:
    drive = Drive()
    drive.goes_on(4.0)
    drive.take("round", a_round(3.5))
    drive.now_s = 6.0
    assert drive.frame().round_age_s == pytest.approx(2.5)
    drive.now_s = 6.6
    assert drive.frame().danger is None


def test_a_cars_clock_that_leaps_back_does_not_make_a_round_young_again() -> None:
    drive = Drive()
    drive.goes_on(4.0)
    drive.take("round", a_round(4.0))
    drive.now_s = 6.0
    drive.take("state", state_at(1.0))
    assert drive.frame().round_age_s == pytest.approx(2.0)


def test_a_round_without_dangers_is_calm_and_an_old_one_says_so() -> None:
    drive = Drive()
    drive.goes_on(6.0)
    harmless = np.zeros(3, dtype=np.float32)
    drive.take("round", msgspec.structs.replace(a_round(5.0), criticality=harmless))
    assert drive.frame().level == "calm"
    assert "no danger found · " in drive.frame().sentence
    drive.take("round", msgspec.structs.replace(a_round(4.0), criticality=harmless))
    assert drive.frame().level == "calm"
    assert "no danger found 2 s ago · " in drive.frame().sentence


def test_where_no_world_counts_any_more_no_round_is_shown() -> None:
    drive = Drive()
    drive.goes_on(4.0)
    drive.take("round", a_round())
    drive.take("active_world", ActiveWorld(stamp_ns=1, world_id=WORLD_ID))
    assert drive.frame().level == "danger"
    drive.take("active_world", ActiveWorld(stamp_ns=2, world_id=None))
    assert (drive.frame().danger, drive.frame().level) == (None, "none")

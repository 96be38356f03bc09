"""The page says what was measured: its tables are those that the measured file makes."""

from __future__ import annotations

import pytest

from tests.scale.__main__ import kept, main
from tests.scale.plan import Prices, cars_at_scale, one_parent, sweep_at_scale
from tests.scale.tables import DOC, TABLES, table, written_into
from tests.scale.test_fit import COSTS, all_runs, measured

CHEAP = ("service", "weights", "held-out", "speed-up", "sweeps")
"""Tables that need no long simulation."""


def test_tables_come_to_their_places_and_nothing_else_changes() -> None:
    page = "before\n<!-- table weights -->\nold\n<!-- end -->\nafter\n"
    told = measured(all_runs())
    new = written_into(page, told, ["weights"])
    assert new.startswith("before\n<!-- table weights -->\n| what | bytes |\n| --- | --- |\n")
    assert "| sweep: Parquet, each future | 700 B |\n" in new
    assert new.endswith("\n<!-- end -->\nafter\n")
    assert written_into(new, told, ["weights"]) == new
    with pytest.raises(ValueError, match="table service has 0 places"):
        written_into(page, told, ["service"])


def test_the_page_has_the_tables_of_the_file() -> None:
    page = DOC.read_text(encoding="utf-8")
    assert written_into(page, kept(), CHEAP) == page
    assert all(f"<!-- table {name} -->" in page for name in TABLES)


def test_a_table_is_markdown() -> None:
    assert table(("a", "b"), [("1", "2")]) == "| a | b |\n| --- | --- |\n| 1 | 2 |"


def test_a_sweep_costs_its_jobs_and_keeps_its_rows() -> None:
    told = measured(all_runs())
    million = sweep_at_scale(told, 1e6, Prices())
    jobs = 1e6 / 64
    job_s = 1.1 * (0.08 + 0.0015 * 64 + (0.06 + 0.1 + 0.3) / 64) + 0.004 + 0.0001 * 64
    assert million.core_hours == pytest.approx(jobs * job_s / 3600.0, rel=0.01)
    assert million.stored_bytes == pytest.approx(1e6 * 800.0)
    assert million.files == pytest.approx(3 * jobs)
    dollars = 0.0408 * million.core_hours, 3 * jobs / 1e3 * 0.005, 0.8 * 0.023
    assert million.dollars == pytest.approx(dollars)
    milliard = sweep_at_scale(told, 1e9, Prices())
    assert milliard.core_hours == pytest.approx(1e3 * million.core_hours)


def test_one_parent_gets_no_more_than_it_can_work_on() -> None:
    job_s = COSTS.parent_job_s + 64 * COSTS.parent_future_s
    many = one_parent(COSTS, 128)
    assert many.futures_per_s == pytest.approx(64 / job_s, rel=0.1)
    assert many.parent_use > 0.9
    few = 4.0 * one_parent(COSTS, 1).futures_per_s
    assert one_parent(COSTS, 4).futures_per_s == pytest.approx(few, rel=0.15)


def test_ten_cars_need_fewer_seats_each_than_one() -> None:
    told = measured(all_runs())
    alone, ten = cars_at_scale(told, 1), cars_at_scale(told, 10)
    assert alone.rounds.late_share <= 0.01
    assert ten.rounds.late_share <= 0.01
    assert ten.seats < 10 * alone.seats
    assert ten.cores == pytest.approx(ten.seats + 10 * 0.1)


def test_an_unknown_word_says_what_there_is(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["guess"]) == 2
    assert "measure | predict | write" in capsys.readouterr().out

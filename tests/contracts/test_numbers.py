"""The table of a future's numbers: what it says holds in code, files and documentation."""

from __future__ import annotations

import math
from pathlib import Path

import msgspec
import pytest

from foretwin.contracts.future_numbers import numbers_of
from foretwin.contracts.futures import Future
from foretwin.contracts.numbers import (
    FUTURE_NUMBERS,
    MAX_EXTRA_DELAY_S,
    MAX_SEED,
    SCENARIO_NUMBERS,
    out_of_range,
)
from foretwin.contracts.scenario import ActorPart, EgoPart, FaultPart, Number, Scenario

DOCS = Path(__file__).parents[2] / "docs"
RESULTS, SCENARIOS = DOCS / "results.md", DOCS / "scenarios.md"


def test_every_number_of_a_scenario_has_a_row() -> None:
    fields = {
        field.name
        for part in (EgoPart, ActorPart)
        for field in msgspec.structs.fields(part)
        if field.type == Number
    }
    assert fields == set(SCENARIO_NUMBERS)
    faults = {name for name, row in FUTURE_NUMBERS.items() if row.part == "fault"}
    assert set(FaultPart.__struct_fields__) == faults
    scenario = Scenario(id="a", title="a", shows="a", source="a")
    assert hash(scenario) == hash(msgspec.structs.replace(scenario)), "scenarios are keys"


def test_neutral_numbers_are_in_range_and_change_nothing() -> None:
    for name, row in FUTURE_NUMBERS.items():
        assert out_of_range(name, row.neutral, row.neutral) == ""
        assert row.joined(0.25, row.neutral) == 0.25
    nothing = numbers_of(Future(index=0, name="nominal"))
    assert nothing == {name: row.neutral for name, row in FUTURE_NUMBERS.items()}


def test_a_futures_own_numbers_join_those_of_its_scenario() -> None:
    future = Future(
        index=0,
        name="both",
        scenario_id="scp",
        values={"faults.friction_factor": 0.5, "faults.perception_delay_s": 0.2},
        numbers={"friction_factor": 0.5, "perception_delay_s": 0.1, "target_speed_factor": 1.1},
    )
    found = numbers_of(future)
    assert (found["friction_factor"], found["perception_delay_s"]) == (0.25, 0.2 + 0.1)
    assert (found["target_speed_factor"], found["brake_gain"]) == (1.1, 1.0)
    alone = numbers_of(msgspec.structs.replace(future, scenario_id=""))
    assert alone["friction_factor"] == 0.5, "values belong to a scenario"


def test_every_range_is_finite() -> None:
    assert MAX_SEED == 2**63 - 1, "as messages and tables hold it"
    for row in (*FUTURE_NUMBERS.values(), *SCENARIO_NUMBERS.values()):
        assert -math.inf < row.range.low < row.range.high < math.inf


def test_what_two_come_to_together_stays_in_range() -> None:
    future = Future(
        index=0,
        name="late",
        scenario_id="scp",
        values={"faults.extra_steering_delay_s": 0.3},
        numbers={"extra_steering_delay_s": 0.4},
    )
    assert numbers_of(future)["extra_steering_delay_s"] == MAX_EXTRA_DELAY_S


@pytest.mark.parametrize(
    ("name", "least", "most", "said"),
    [
        ("friction_factor", 0.0, 1.0, "reaches 0; it must be above 0, at most 4"),
        ("brake_gain", 0.0, 1.0, ""),
        ("brake_gain", -0.5, 1.0, "reaches -0.5; it must be from 0 to 10"),
        ("extra_steering_delay_s", 0.0, 0.5, "reaches 0.5; it must be from 0 to 0.4"),
        ("impact_share", -0.1, 1.0, "reaches -0.1; it must be from 0 to 1"),
        ("lateral_shift_m", -9.0, math.inf, "must be finite"),
        ("lateral_shift_m", -9.0, 1e5, "reaches 100000; it must be from -50 to 50"),
        ("steering_gain", 1.0, 1e308, "reaches 1e+308; it must be from -10 to 10"),
        ("friction_factor", 1.0, 1e9, "reaches 1e+09; it must be above 0, at most 4"),
        ("perception_delay_s", 0.0, 1e300, "reaches 1e+300; it must be from 0 to 10"),
        ("speed_mps", 0.0, 1e3, "reaches 1000; it must be from 0 to 100"),
    ],
)
def test_what_is_out_of_range_is_said(name: str, least: float, most: float, said: str) -> None:
    assert out_of_range(name, least, most) == said


def test_the_documentation_has_the_same_table() -> None:
    told = [line for line in RESULTS.read_text(encoding="utf-8").splitlines() if "`" in line]
    for name, row in FUTURE_NUMBERS.items():
        line = next(line for line in told if line.startswith(f"| `{name}` |"))
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        assert cells[1:] == [row.unit, str(row.range), _operation(name), row.meaning]
    told = [line for line in SCENARIOS.read_text(encoding="utf-8").splitlines() if "`" in line]
    for name, number in SCENARIO_NUMBERS.items():
        line = next(line for line in told if line.startswith(f"| `{name}` |"))
        assert [cell.strip() for cell in line.split("|")[2:4]] == [number.unit, str(number.range)]


def _operation(name: str) -> str:
    row = FUTURE_NUMBERS[name]
    return f"{'times' if row.operation == 'multiply' else 'added to'} `{row.acts_on}`"

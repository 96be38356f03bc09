"""What the driving says: rows, words and the record."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from foretwin.contracts.gap import Evidence, GapAlarm, GapSample, Verdict
from foretwin.contracts.tuning import Identification, ParameterEstimate, TuneReply
from foretwin.orchestrator.instructions import Notice
from foretwin.orchestrator.record.results import ResultTables
from foretwin.orchestrator.tuning.findings import Findings
from foretwin.orchestrator.tuning.words import summary_lines
from foretwin.sim_worker.vehicle.parameters import load_vehicle

COVERS = ("foretwin.orchestrator.tuning.words",)

CAR = load_vehicle()


def gap(across_m: float, *, horizon_s: float = 2.0, independent: bool = True) -> GapSample:
    return GapSample(
        vehicle_id="ego", stamp_ns=5, horizon_s=horizon_s, manoeuvre="curve", along_m=0.0,
        across_m=across_m, yaw_rad=0.1, yaw_rate_radps=0.0, speed_mps=0.0, accel_mps2=0.0,
        independent=independent,
    )  # fmt: skip


VERDICT = Verdict(
    vehicle_id="ego", stamp_ns=9_000_000_000, since_stamp_ns=7, culprit="model",
    cause="steering_ratio", text="the model turns 14 % less", confidence=0.98,
    evidence=(Evidence(name="gain", value=0.86, expected=1.0, std=0.01, text="by the tyre"),),
)  # fmt: skip
ALARM = GapAlarm(
    vehicle_id="ego", stamp_ns=6, quantity="yaw_rad", value=-0.2, limit=0.14, manoeuvre="curve"
)
FOUND = Identification(
    vehicle_id="ego", from_stamp_ns=0, stamp_ns=8,
    estimates=(
        ParameterEstimate(name="steering_ratio", value=15.3, low=15.1, high=15.5),
        ParameterEstimate(name="drive_gain", value=1.01, low=0.9, high=1.1),
        ParameterEstimate(name="drag_npv2", value=None, low=None, high=None, reason="no grade"),
    ),
)  # fmt: skip


class Kept:
    """Findings that were taken, and what became of them."""

    def __init__(self, folder: Path, *replies: TuneReply) -> None:
        self.told: list[Notice] = []
        self.identified: list[Identification] = []
        tables = ResultTables(folder, {}, lossless=True)
        findings = Findings(
            tables, tell=self.told.append, start_stamp_ns=lambda: 0, vehicle=lambda: CAR,
            on_identification=self.identified.append,
        )  # fmt: skip
        for reply in replies:
            findings.take_all(reply)
        tables.close()
        self.record: dict[str, Any] = {"changes": [], **findings.record()}
        self._folder = folder

    def rows(self, table: str) -> list[dict[str, Any]]:
        rows: list[dict[str, Any]] = pq.read_table(self._folder / f"{table}.parquet").to_pylist()
        return rows


def test_findings_are_kept_told_and_counted(tmp_path: Path) -> None:
    gaps = (gap(3.0), gap(4.0), gap(9.0, horizon_s=8.0))
    reply = TuneReply(identifications=(FOUND,), gaps=gaps, alarms=(ALARM,), verdicts=(VERDICT,))
    kept = Kept(tmp_path, reply)
    assert kept.identified == [FOUND]
    assert [row["across_m"] for row in kept.rows("gaps")] == [3.0, 4.0, 9.0]
    assert [row["taken"] for row in kept.rows("identifications")] == [True, True, False]
    (verdict,) = kept.rows("verdicts")
    assert verdict["evidence"] == "gain 0.86 ± 0.01, expected 1"
    rms = kept.record["gap"]["rms"]
    assert rms["curve"] == rms["all"]
    assert rms["all"]["across_m"] == round(math.sqrt(12.5), 4)
    assert [(tell.level, tell.text) for tell in kept.told] == [
        ("info", "steering_ratio: the driving says 15.3 (15.1 to 15.5), in use is 16"),
        ("warning", "gap: heading off by -11.46 ° (curve, limit 8 °)"),
        ("warning", "verdict: the model, steering_ratio (0.98): the model turns 14 % less"),
    ]


def test_the_end_of_a_drive_tells_it_in_a_few_lines(tmp_path: Path) -> None:
    reply = TuneReply(identifications=(FOUND,), gaps=(gap(0.3),), verdicts=(VERDICT,))
    assert summary_lines(Kept(tmp_path, reply).record) == [
        "  left to itself for 2 s, the model is off by 0.00 m along the road, 0.30 m across, 5.7° "
        "and 0.00 m/s (RMS); 0 alarms, beyond a limit 0 of 1 times",
        "  verdict at 9.0 s: the model, steering_ratio: the model turns 14 % less",
        "  found, within what the vehicle file leaves open: steering_ratio 15.3",
    ]


@pytest.mark.parametrize(
    ("reply", "told"),
    [
        (TuneReply(gaps=(gap(0.3),)), ["0 alarms, beyond a limit 0 of 1", "nothing shows that"]),
        (
            TuneReply(gaps=(gap(1.3), gap(1.3)), alarms=(ALARM,)),
            ["1 alarm, beyond a limit 2 of 2", "the gap was beyond its limits, and nothing shows"],
        ),
        (
            TuneReply(gaps=(gap(0.3), gap(9.0, independent=False), gap(0.3))),
            [
                "0.30 m across, 5.7° and 0.00 m/s (RMS); 0 alarms, beyond a limit 0 of 2 times "
                "(commands were missing 1 time more)",
                "nothing shows that",
            ],
        ),
        (
            TuneReply(gaps=(gap(9.0, independent=False),)),
            ["no limits hold, since commands were estimated", "no commands were recorded"],
        ),
    ],
    ids=["within", "beyond", "some lost", "estimated commands"],
)
def test_a_summary_counts_by_the_limits_of_the_alarms(
    tmp_path: Path, reply: TuneReply, told: list[str]
) -> None:
    lines = summary_lines(Kept(tmp_path, reply).record)
    for line, part in zip(lines, told, strict=True):
        assert part in line


def test_runs_by_estimated_commands_are_counted_one_by_one(tmp_path: Path) -> None:
    estimated = gap(9.0, independent=False)
    told = Kept(tmp_path, TuneReply(gaps=(gap(0.3), estimated, estimated))).record["gap"]
    assert (told["samples"], told["without_commands"], told["independent"]) == (1, 2, True)


def test_a_drive_without_any_run_had_none_by_estimated_commands(tmp_path: Path) -> None:
    told = Kept(tmp_path).record["gap"]
    assert (told["samples"], told["without_commands"], told["independent"]) == (0, 0, True)


def test_a_value_that_the_vehicle_file_leaves_open_is_no_other_car(tmp_path: Path) -> None:
    """The bundled stand-in as it is identified: nothing in it contradicts the twin's own file."""
    standin = {
        "steering_ratio": 15.41, "steering_offset_rad": 0.0038, "steering_lag_s": 0.0833,
        "understeer_gradient_rad_per_mps2": -0.00034, "drag_npv2": 0.42, "brake_gain": 1.06,
    }  # fmt: skip
    estimates = tuple(
        ParameterEstimate(name=name, value=value, low=value - 1e-5, high=value + 1e-5)
        for name, value in (*standin.items(), ("drive_gain", 0.7))
    )
    told = Identification(vehicle_id="ego", from_stamp_ns=0, stamp_ns=8, estimates=estimates)
    finer, other = summary_lines(Kept(tmp_path, TuneReply(identifications=(told,))).record)
    assert all(name in finer for name in standin)
    assert other == "  drive_gain: the driving says 0.7 (0.69999 to 0.70001), in use is 1"


def test_a_departure_is_told_once_and_a_drive_without_findings_says_nothing(tmp_path: Path) -> None:
    (tmp_path / "none").mkdir()
    reply = TuneReply(identifications=(FOUND,))
    kept = Kept(tmp_path, reply, reply)
    assert len(kept.told) == 1
    assert summary_lines(Kept(tmp_path / "none").record) == []


def test_many_departures_share_a_line(tmp_path: Path) -> None:
    names = ("steering_ratio", "drive_gain", "brake_gain", "mass_kg")
    estimates = tuple(ParameterEstimate(name=name, value=3.0, low=2.9, high=3.1) for name in names)
    told = Identification(vehicle_id="ego", from_stamp_ns=0, stamp_ns=8, estimates=estimates)
    (line,) = summary_lines(Kept(tmp_path, TuneReply(identifications=(told,))).record)
    assert line == (
        "  the driving says other than the vehicle in use: steering_ratio 3, drive_gain 3, "
        "brake_gain 3, mass_kg 3"
    )

"""What a drive counts: samples lost, futures and their hash, errors, latencies."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.running import RunningQuantiles
from foretwin.contracts.simulation import Comparison, HorizonError
from foretwin.orchestrator.record.bookkeeping import (
    ComparisonCount,
    FuturesCount,
    TelemetryCount,
    percentile,
)
from tests.orchestrator.futures_rounds import round_done, straight


def counted(*seqs: int) -> TelemetryCount:
    count = TelemetryCount()
    for sent_ns, seq in enumerate(seqs):
        count.take("gnss", sender=0, seq=seq, sent_ns=sent_ns, now_ns=sent_ns)
    return count


def test_gaps_in_the_numbering_are_losses() -> None:
    assert (counted(0, 1, 2).received, counted(0, 1, 2).lost) == (3, 0)
    assert counted(0, 1, 5, 6, 9).lost == 5


def test_a_sender_that_begins_anew_has_lost_nothing() -> None:
    assert counted(7, 8, 9, 0, 1, 2).lost == 0


@given(st.sets(st.integers(0, 200), min_size=1))
def test_what_arrives_and_what_is_lost_make_up_what_was_sent(arrived: set[int]) -> None:
    count = counted(*sorted(arrived))

    assert count.received + count.lost == max(arrived) - min(arrived) + 1


def test_each_key_has_its_own_numbering() -> None:
    count = counted(0, 1, 2)
    for seq in (40, 42):
        count.take("imu", sender=0, seq=seq, sent_ns=seq, now_ns=seq)

    assert count.lost == 1


def test_what_the_vehicle_says_it_sent_settles_the_losses() -> None:
    count = counted(3, 4, 6)  # the first three went before we listened, one on the way
    assert count.lost == 1
    count.settle({"gnss": 8, "imu": 10})

    assert count.lost == 5 + 10
    count.settle({"gnss": 3})
    assert count.lost == 15  # never fewer than known


def test_of_what_is_no_sample_nothing_is_lost() -> None:
    count = counted(0, 1)
    count.settle({"gnss": 2, "end": 1, "wheel_ticks": 500, "real_cloud": 90})

    assert count.lost == 0


def test_a_sample_that_came_twice_stands_for_no_other() -> None:
    count = counted(0, 1)
    count.take("gnss", sender=0, seq=1, sent_ns=1, now_ns=1)
    count.settle({"gnss": 3})

    assert (count.received, count.lost) == (3, 1)


def test_a_sample_that_was_refused_is_not_lost_as_well() -> None:
    count = counted(0)
    count.came("gnss", sender=0, seq=1, sent_ns=1)
    count.take("gnss", sender=0, seq=2, sent_ns=2, now_ns=2)
    count.settle({"gnss": 3})

    assert (count.received, count.lost) == (2, 0)


def test_ages_are_given_as_percentiles() -> None:
    count = TelemetryCount()
    for age in range(101):
        count.take("gnss", sender=0, seq=age, sent_ns=0, now_ns=age * 1_000_000)

    record = count.record(skipped_invalid=4)
    assert (record["age_ms_p50"], record["age_ms_p95"]) == (50.0, 95.0)
    assert record["skipped_invalid"] == 4
    assert percentile(RunningQuantiles(), 50) is None


def test_futures_are_counted_and_hashed_in_order() -> None:
    one = round_done(straight(), straight((0.0, 1.0)))
    other = round_done(straight(speed_mps=9.0))

    def hash_of(*rounds: object) -> str:
        count = FuturesCount()
        for done in rounds:
            count.take(done, distinct=1)  # type: ignore[arg-type]
        return count.record(wanted=64, missed=0, spared=0, unseeded=0)["sha256"]

    assert hash_of(one, other) == hash_of(one, other)
    assert len({hash_of(one, other), hash_of(other, one), hash_of(one), hash_of()}) == 4
    nudged = straight()
    nudged[0, 40, 0] += 1e-4
    assert hash_of(round_done(nudged)) != hash_of(round_done(straight()))


def test_the_hash_knows_no_worker_and_no_latency() -> None:
    quick, slow = FuturesCount(), FuturesCount()
    done = round_done(straight(), straight((0.0, 1.0)))
    quick.take(done, distinct=2)
    others = tuple(msgspec.structs.replace(r, worker_id="w9") for r in done.results)
    slow.take(replace(done, results=others, latency_ms=900.0), distinct=2)

    assert quick.record(wanted=64, missed=0, spared=0, unseeded=0) == slow.record(
        wanted=64, missed=0, spared=0, unseeded=0
    )


def test_a_futures_record_adds_up() -> None:
    count = FuturesCount()
    count.take(round_done(straight(), straight((0.0, 1.0)), latency_ms=80.0), distinct=2)
    count.take(round_done(straight(), latency_ms=120.0), distinct=1)
    record = count.record(wanted=64, missed=3, spared=0, unseeded=1)

    assert (record["count"], record["rounds"], record["distinct"]) == (3, 2, 3)
    assert record["distinct_min_per_round"] == 1
    assert (record["missed_rounds"], record["unseeded_rounds"]) == (3, 1)
    assert (record["sim_seconds"], record["cpu_seconds"]) == (24.0, 1.5)
    assert percentile(count.latencies_ms, 50) == 100.0


def test_futures_whose_scenario_has_no_place_are_counted_by_the_reason() -> None:
    count, done = FuturesCount(), round_done(straight(), straight(), straight())
    for reasons in (("", "behind", "beyond"), ("", "", "behind")):
        results = tuple(
            msgspec.structs.replace(result, left_out=(reason,))
            for result, reason in zip(done.results, reasons, strict=True)
        )
        count.take(replace(done, results=results), distinct=3)
    record = count.record(wanted=64, missed=0, spared=0, unseeded=0)

    assert (record["count"], record["not_placed"]) == (6, {"behind": 2, "beyond": 1})


def test_futures_that_failed_or_were_driven_by_another_planner_are_counted_by_the_reason() -> None:
    count, done = FuturesCount(), round_done(straight(), straight((0.0, 1.0)))
    for failures, remarks in ((("", "NaN"), ()), ((), ("the fallback acted", ""))):
        said = {"failures": failures, "remarks": remarks}
        results = tuple(
            msgspec.structs.replace(result, outcome=msgspec.structs.replace(result.outcome, **said))
            for result in done.results
        )
        count.take(replace(done, results=results), distinct=2)
    record = count.record(wanted=64, missed=0, spared=0, unseeded=0)

    each = len(done.results)
    assert record["failed"] == {"NaN": each}
    assert record["remarked"] == {"the fallback acted": each}


def error(ade_m: float) -> HorizonError:
    return HorizonError(ade_m=ade_m, fde_m=0.0, lateral_m=0.0, longitudinal_m=0.0, heading_rad=0.0)


def test_errors_are_averaged_by_horizon() -> None:
    count = ComparisonCount()
    for ade_m in (1.0, 3.0):
        count.take(
            Comparison(
                round_id=0, stamp_ns=0, intersection_id="n4", horizon_s=4.0, nominal=error(ade_m),
                constant_velocity=error(2 * ade_m), constant_turn_rate=error(3 * ade_m),
            )
        )  # fmt: skip
    record = count.record(independent=False)

    assert record["ade_m"] == {"4": 2.0}
    assert record["constant_velocity_ade_m"] == {"4": pytest.approx(4.0)}
    assert record["constant_turn_rate_ade_m"] == {"4": pytest.approx(6.0)}
    assert (record["count"], record["independent"]) == ({"4": 2}, False)

"""Jobs are known by what they say."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from foretwin.contracts.codec import SchemaMismatch, decode, encode
from foretwin.contracts.forecast import ProgressForecast
from foretwin.contracts.futures import Job
from foretwin.contracts.job_identity import future_id, job_bytes, job_from_bytes
from tests.sim_worker.places import happening, job

JOB = job((happening(0, "scp"), happening(1, "cpta")))


def test_a_job_keeps_its_hash_over_the_wire_and_on_disk() -> None:
    recorded = job_bytes(JOB)
    assert job_bytes(decode(encode(JOB), Job).message) == recorded
    again = job_from_bytes(recorded.data, where="here")
    assert job_bytes(again) == recorded
    assert np.array_equal(again.path.xy_m, JOB.path.xy_m)


@pytest.mark.parametrize("change", [{"seed": 1}, {"control_hz": 50.0}, {"vehicle": "another"}])
def test_another_job_has_another_hash(change: dict[str, object]) -> None:
    other = msgspec.structs.replace(JOB, **change)
    assert job_bytes(other).sha256 != job_bytes(JOB).sha256


def test_ids_of_futures_name_the_job_and_the_place_in_it() -> None:
    assert future_id("0123456789abcdef", 7) == "0123456789ab-7"
    with pytest.raises(SchemaMismatch, match="here: no valid Job"):
        job_from_bytes(b"\x80", where="here")


def test_a_job_without_a_forecast_has_the_bytes_that_it_had_before_there_were_any() -> None:
    forecast = ProgressForecast(
        time_s=np.array([1.0]), levels=np.array([0.5]), distance_m=np.array([[10.0]])
    )
    told = msgspec.structs.replace(JOB, progress=forecast)

    assert b"progress" not in job_bytes(JOB).data
    assert b"progress" in job_bytes(told).data
    back = job_from_bytes(job_bytes(told).data, where="here")
    assert isinstance(back.progress, ProgressForecast)
    assert back.progress.distance_m.tolist() == [[10.0]]

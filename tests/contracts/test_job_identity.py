"""Jobs are known by what they say."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest

from foretwin.contracts.codec import SchemaMismatch, decode, encode
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

"""The list of parts: what was added is there, the last of a job counts, a cut line costs itself."""

from __future__ import annotations

import errno
from pathlib import Path

import pytest
from msgspec.structs import replace

from foretwin.contracts.parts import CaseCount
from foretwin.orchestrator.sweep.manifest import MANIFEST, Manifest, PartEntry

COUNT = CaseCount(
    scenario="scp", planner="p", cases=1, placed=1, collided=0, failed=0, clearance_m=(1 / 3,)
)
ENTRY = PartEntry(
    job=0, job_sha256="a", rows=1, rows_sha256="b", tables={"jobs": "c"}, counts=(COUNT,)
)


def test_the_last_entry_of_a_job_counts_and_they_come_in_the_order_of_jobs(tmp_path: Path) -> None:
    with Manifest(tmp_path, jobs=5) as manifest:
        for job in (4, 0, 2, 0):
            manifest.add(replace(ENTRY, job=job, rows=manifest.path.stat().st_size))
        written = [(entry.job, entry.rows) for entry in manifest.entries()]
        assert [job for job, _ in written] == [0, 2, 4]
        assert [manifest.lists(job) for job in range(5)] == [True, False, True, False, True]
        assert manifest.entry(3) is None
    with Manifest(tmp_path, jobs=4) as shorter:
        assert [(entry.job, entry.rows) for entry in shorter.entries()] == written[:2]
        assert shorter.entry(0) == replace(ENTRY, rows=written[0][1])


@pytest.mark.parametrize("end", [b'{"job": 1, "job_sh', b"\0\0\0\n", b'{"job": 9999999999}\n'])
def test_a_line_that_is_no_entry_costs_itself_alone(tmp_path: Path, end: bytes) -> None:
    with Manifest(tmp_path, jobs=4) as manifest:
        manifest.add(ENTRY)
    with (tmp_path / MANIFEST).open("ab") as file:
        file.write(end)
    with Manifest(tmp_path, jobs=4) as manifest:
        assert [entry.job for entry in manifest.entries()] == [0]
        manifest.add(replace(ENTRY, job=1))
    with Manifest(tmp_path, jobs=4) as manifest:
        assert [entry.job for entry in manifest.entries()] == [0, 1]


def test_what_a_full_disk_takes_half_of_is_not_there(tmp_path: Path) -> None:
    with Manifest(tmp_path, jobs=4) as manifest:
        manifest.add(ENTRY)
        whole = manifest.path.read_bytes()
        file = manifest._file

        class Full:
            def __getattr__(self, name: str) -> object:
                return getattr(file, name)

            def write(self, data: bytes) -> int:
                return file.write(data[:20])

        manifest._file = Full()  # type: ignore[assignment]
        with pytest.raises(OSError, match="No space left") as told:
            manifest.add(replace(ENTRY, job=1))
        assert told.value.errno == errno.ENOSPC
        assert manifest.path.read_bytes() == whole
        assert manifest.entry(1) is None

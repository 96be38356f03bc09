"""What workers on other machines are called."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.fleet import MOST_CLOCK_OFFSET_S, far_id, is_far, machine_of
from tests.pages import page


@given(st.from_regex(r"[a-z0-9]{1,40}", fullmatch=True), st.integers(0, 200))
def test_the_machine_comes_back_out_of_a_workers_id(machine: str, number: int) -> None:
    worker_id = far_id(machine, number)
    assert is_far(worker_id)
    assert machine_of(worker_id) == machine


def test_a_drives_own_workers_are_near() -> None:
    assert not any(map(is_far, ("w0", "w12", "mirror", "worker")))


def test_the_page_tells_how_far_a_clock_may_be_off() -> None:
    assert f"More than {MOST_CLOCK_OFFSET_S:g} s off is refused" in page("workers.md")

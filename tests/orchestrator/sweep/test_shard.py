"""A shard is an equal stretch of a plan, named as arrays of jobs number theirs."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.errors import UserError
from foretwin.orchestrator.sweep.shard import WHOLE, Shard


@given(st.integers(0, 10_000), st.integers(1, 50))
def test_every_job_is_in_one_shard_and_none_has_many_more_than_another(jobs: int, of: int) -> None:
    shards = [Shard(number, of).numbers(jobs) for number in range(of)]
    assert [job for numbers in shards for job in numbers] == list(range(jobs))
    sizes = {len(numbers) for numbers in shards}
    assert max(sizes) - min(sizes) <= 1


def test_a_shard_is_named_by_its_number_and_how_many_there_are() -> None:
    assert Shard.named("2/3") == Shard(2, 3)
    assert str(Shard(2, 3)) == "2/3"
    assert Shard.named("0/1") == WHOLE


@pytest.mark.parametrize("words", ["3/3", "1", "-1/3", "1/0", "1/3/5", "a/b", "", "\u0661/\u0663"])
def test_what_names_no_shard_is_refused(words: str) -> None:
    with pytest.raises(UserError, match=r"^--shard .*: i/n, with i from 0 to n - 1"):
        Shard.named(words)

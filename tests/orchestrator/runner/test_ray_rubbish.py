"""A task whose answer is rubbish is asked again, of another node, and at most three times."""

from __future__ import annotations

from collections.abc import Iterator

from foretwin.contracts.runner import TRIES, Answer, answers
from tests.orchestrator.runner.one_by_one import OneByOne, counted, on, task

RUBBISH = b"\xc1 rubbish"


def told(cluster: OneByOne, *ends: tuple[str, bytes | None]) -> Iterator[Answer]:
    """Yield what becomes of one task that is answered by these nodes, in turn."""
    runner = on(cluster)
    left = iter(ends)
    take = runner.take

    def taken(timeout_s: float | None = 0.0) -> Answer | None:
        node, data = next(left)
        cluster.end(node=node, **({} if data is None else {"data": data}))
        return take(timeout_s)

    runner.take = taken  # type: ignore[method-assign]
    yield from answers(runner, [task("a")])
    given, *ended = counted(runner)
    assert given == sum(ended) == len(ends)


def test_another_node_is_asked_after_rubbish() -> None:
    cluster = OneByOne()

    (answer,) = told(cluster, ("n1", RUBBISH), ("n2", RUBBISH), ("n3", None))

    assert (answer.failure, answer.worker_id) == ("", "n3-0")
    assert cluster.away_from == [set(), {"n1"}, {"n1", "n2"}]


def test_what_three_answer_with_rubbish_is_given_up() -> None:
    cluster = OneByOne()

    (answer,) = told(cluster, *TRIES * [("n1", RUBBISH)])

    assert answer.message is None
    assert answer.failure.startswith("Refused: prepare of n1-0: ")


def test_a_refusal_in_words_is_an_answer() -> None:
    cluster = OneByOne()
    runner = on(cluster)
    runner.submit(task("a"))
    cluster.end(refusal="ValueError: no", data=b"")

    answer = runner.take()

    assert answer is not None
    assert not answer.garbled


def test_of_a_thousand_tasks_it_is_known_who_answered_and_of_older_ones_not() -> None:
    cluster = OneByOne()
    runner = on(cluster)
    for key in ("older", "old", *(f"{number}" for number in range(1023))):
        runner.submit(task(key))
        cluster.end()
        assert runner.take() is not None

    for key in ("older", "old"):
        runner.submit(task(key))

    assert cluster.away_from[-2:] == [set(), {"n1"}]

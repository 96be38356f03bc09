"""What is missing by the senders' numbering, held against a plain model of what was sent."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.sequence_gaps import MOST_GAP, SequenceGaps

TURN = 2**64


class Sent(NamedTuple):
    """A message on its way: its number, its sender's clock, and which message it really is."""

    seq: int
    sent_ns: int
    one: int


def numbered(count: int, *, start: int = 0, clock_ns: int = 1_000) -> list[Sent]:
    return [Sent((start + n) % TURN, clock_ns + n, clock_ns + n) for n in range(count)]


def heard(sent: Iterable[Sent], gaps: SequenceGaps | None = None) -> SequenceGaps:
    gaps = gaps or SequenceGaps()
    for one in sent:
        gaps.take("key", one.seq, sent_ns=one.sent_ns)
    return gaps


def test_what_comes_in_order_is_complete() -> None:
    assert heard(numbered(100)).lost == 0


def test_what_was_sent_before_anyone_listened_is_not_lost() -> None:
    assert heard(numbered(10, start=5_000)).lost == 0


def test_a_sender_that_begins_anew_costs_nothing_and_its_first_ones_are_missed() -> None:
    before = numbered(300)
    assert heard([*before, *numbered(50, clock_ns=10_000)]).lost == 0
    assert heard([*before, *numbered(50, clock_ns=10_000)[4:]]).lost == 4


def test_one_old_number_between_new_ones_costs_nothing() -> None:
    """As it was: 21,267 of 4,487 lost, since each return to the new numbers was a gap."""
    drive = numbered(4_487)
    mixed = [one for number, one in enumerate(drive) for one in (one, drive[number // 40])]

    assert heard(mixed).lost == 0


def test_two_senders_of_one_key_have_a_numbering_each() -> None:
    pairs = zip(numbered(400, start=9_000), numbered(400, clock_ns=1_001), strict=True)

    assert heard(one for pair in pairs for one in pair).lost == 0


def test_a_strangers_number_far_ahead_is_no_gap() -> None:
    drive = numbered(100, start=1_000)
    far = Sent(2**63, 1_050, 0)
    assert heard([*drive[:50], far, *drive[50:]]).lost == 0

    within_reach = Sent(1_099, 1_049, 0)  # a gap at first, which what really comes then fills
    assert heard([*drive[:50], within_reach, *drive[50:]]).lost == 0


def test_numbers_begin_anew_after_the_last() -> None:
    sent = numbered(20, start=TURN - 10)

    assert heard(sent).lost == 0
    assert heard([*sent[:8], *sent[13:]]).lost == 5


@st.composite
def networks(draw: st.DrawFn) -> tuple[list[Sent], int]:
    """What arrives of one sender's lives, and how many of its messages never came."""
    arrived: list[Sent] = []
    lost = 0
    clock_ns = 1_000
    for life in range(draw(st.integers(1, 3))):
        start = draw(st.sampled_from([0, 500, TURN - 30])) if life == 0 else 0
        count = draw(st.integers(70 if life == 0 else 1, 120))
        sent = numbered(count, start=start, clock_ns=clock_ns)
        clock_ns += 100_000
        # The first and the last always come: what was before or after them nobody can know. In a
        # later life all come, and in order: numbers alone do not tell its gaps from earlier ones.
        drops = draw(st.sets(st.integers(1, max(1, count - 2)), max_size=20)) if life == 0 else ()
        kept = [one for n, one in enumerate(sent) if n not in drops or n in (0, count - 1)]
        lost += count - len(kept)
        held: list[tuple[int, Sent]] = [
            (n + (draw(st.integers(0, 12)) if life == 0 and 0 < n < len(kept) - 1 else 0), one)
            for n, one in enumerate(kept)
        ]
        held = [(min(n, len(kept) - 1), one) for n, one in held]
        ordered = [one for _, one in sorted(held, key=lambda pair: pair[0])]
        doubled = draw(st.sets(st.integers(0, len(ordered) - 1), max_size=10))
        arrived += [one for n, o in enumerate(ordered) for one in [o] * (2 if n in doubled else 1)]
    return arrived, lost


@given(networks())
def test_lost_is_what_was_sent_and_never_came(network: tuple[list[Sent], int]) -> None:
    arrived, lost = network
    gaps = heard(arrived)

    assert gaps.lost == lost
    assert gaps.doubled == len(arrived) - len({one.one for one in arrived})


@given(st.lists(st.tuples(st.integers(0, TURN - 1), st.integers(-(2**63), 2**63 - 1))))
def test_whatever_comes_less_is_never_lost_than_nothing(
    numbers: list[tuple[int, int]],
) -> None:
    gaps = heard(Sent(seq, sent_ns, 0) for seq, sent_ns in numbers)

    assert 0 <= gaps.lost <= MOST_GAP * len(numbers)

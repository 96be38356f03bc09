"""What came and what is missing, held against a plain model of what was sent."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.numbering import MOST_GAP, Numbering, Numberings


class Sent(NamedTuple):
    """A message on its way: its number, its sender's clock and id, and which one it really is."""

    seq: int
    sent_ns: int
    sender: int = 0


def numbered(count: int, *, start: int = 0, clock_ns: int = 1_000, sender: int = 0) -> list[Sent]:
    return [Sent(start + n, clock_ns + n, sender) for n in range(count)]


def heard(sent: Iterable[Sent]) -> Numberings:
    numbers = Numberings()
    for one in sent:
        numbers.take("imu", one.seq, sender=one.sender, sent_ns=one.sent_ns)
    return numbers


def lost(sent: Iterable[Sent]) -> int:
    return heard(sent).missing["imu"]


def test_what_comes_in_order_is_complete() -> None:
    assert lost(numbered(100)) == 0


@pytest.mark.parametrize("sender", [0, 7])
def test_what_was_sent_before_anyone_listened_is_not_lost(sender: int) -> None:
    numbers = heard(numbered(10, start=5_000, sender=sender))
    assert (numbers.missing["imu"], numbers.published["imu"]) == (0, 10)


def test_the_first_two_may_come_in_the_other_order() -> None:
    one, other, *rest = numbered(10, sender=7)
    numbers = heard([other, one, *rest])
    assert (numbers.missing["imu"], numbers.published["imu"], numbers.doubled) == (0, 10, 0)


def test_a_first_message_that_comes_twice_leaves_no_hole() -> None:
    first, *rest = numbered(10, start=5_000, sender=7)
    numbers = heard([first, first, *rest])
    (stream,) = numbers.streams.values()
    assert (numbers.doubled, stream.holes) == (1, [])


@pytest.mark.parametrize("senders", [(0, 0), (7, 8)])
def test_a_sender_that_begins_anew_costs_nothing_and_its_first_ones_are_missed(
    senders: tuple[int, int],
) -> None:
    before = numbered(300, sender=senders[0])
    after = numbered(50, clock_ns=10_000, sender=senders[1])
    assert lost([*before, *after]) == 0
    assert lost([*before, *after[4:]]) == 4


def test_the_gaps_of_a_later_life_are_its_own() -> None:
    before = [one for one in numbered(100, sender=7) if one.seq not in (40, 41, 42)]
    after = [one for one in numbered(90, clock_ns=10_000, sender=8) if one.seq not in (41, 60)]
    assert lost([*before, *after]) == 3 + 2


def test_one_old_number_between_new_ones_costs_nothing() -> None:
    """As it was: 21,267 of 4,487 lost, since each return to the new numbers was a gap."""
    for sender in (0, 7):
        drive = numbered(4_487, sender=sender)
        mixed = [one for number, one in enumerate(drive) for one in (one, drive[number // 40])]
        assert lost(mixed) == 0


@pytest.mark.parametrize("senders", [(0, 0), (7, 8)])
def test_two_senders_of_one_key_have_a_numbering_each(senders: tuple[int, int]) -> None:
    one = numbered(400, start=9_000, sender=senders[0])
    other = numbered(400, clock_ns=1_001, sender=senders[1])

    assert lost(sent for pair in zip(one, other, strict=True) for sent in pair) == 0


def test_a_strangers_number_far_ahead_is_no_gap() -> None:
    drive = numbered(100, start=1_000, sender=7)
    far = Sent(2**64 - 1, 1_050, 7)
    assert lost([*drive[:50], far, *drive[50:]]) == 0

    within_reach = Sent(1_099, 1_049, 7)  # a gap at first, which what really comes then fills
    assert lost([*drive[:50], within_reach, *drive[50:]]) == 0


@st.composite
def networks(draw: st.DrawFn) -> tuple[list[Sent], int]:
    """What arrives of one sender's lives, and how many of its messages never came."""
    arrived: list[Sent] = []
    never = 0
    clock_ns = 1_000
    for life in range(draw(st.integers(1, 3))):
        count = draw(st.integers(20, 120))
        start = draw(st.sampled_from([0, 500])) if life == 0 else 0
        sent = numbered(count, start=start, clock_ns=clock_ns, sender=life + 1)
        clock_ns += draw(st.sampled_from([-100_000, 100_000]))
        # The first and the last always come: what was before or after them nobody can know.
        drops = draw(st.sets(st.integers(1, count - 2), max_size=20))
        kept = [one for n, one in enumerate(sent) if n not in drops]
        never += count - len(kept)
        late = [n + draw(st.integers(0, 12)) for n in range(len(kept))]
        ordered = [one for _, one in sorted(zip(late, kept, strict=True), key=lambda pair: pair[0])]
        doubled = draw(st.sets(st.integers(0, len(ordered) - 1), max_size=10))
        arrived += [one for n, o in enumerate(ordered) for one in [o] * (2 if n in doubled else 1)]
    return arrived, never


@given(networks())
def test_lost_is_what_was_sent_and_never_came(network: tuple[list[Sent], int]) -> None:
    arrived, never = network
    numbers = heard(arrived)

    assert numbers.missing["imu"] == never
    assert numbers.doubled == len(arrived) - len(set(arrived))
    assert numbers.published["imu"] == len(set(arrived)) + never


@given(
    st.lists(
        st.tuples(
            st.integers(-(2**63), 2**64 - 1),
            st.integers(-(2**63), 2**63 - 1),
            st.sampled_from([0, 7]),
        )
    )
)
def test_whatever_comes_the_counts_hold(messages: list[tuple[int, int, int]]) -> None:
    numbers = Numberings()
    came = sum(
        numbers.take("imu", seq, sent_ns=sent_ns, sender=sender) is not None
        for seq, sent_ns, sender in messages
    )
    assert came + numbers.doubled == len(messages)
    assert numbers.published["imu"] == came + numbers.missing["imu"]
    assert 0 <= numbers.missing["imu"] <= (MOST_GAP + 64) * len(messages)


def test_what_a_sender_says_it_sent_is_missing_until_it_comes() -> None:
    numbers = Numberings()
    numbers.reach("imu", 5, sender=7)
    assert numbers.missing["imu"] == 5
    assert numbers.take("imu", 2, sender=7, sent_ns=100)
    numbers.reach("imu", 3, sender=7)
    assert (numbers.published["imu"], numbers.missing["imu"]) == (5, 4)


def test_a_number_whose_sender_is_not_told_is_of_who_was_heard_last() -> None:
    numbers = Numberings()
    for channel, sender in (("imu", 7), ("imu", 8), ("gnss", 9)):
        for seq in (0, 1, 4):
            numbers.take(channel, seq, sender=sender)
    assert numbers.take_up("imu", 5), "it goes on with the last one"
    assert numbers.take_up("imu", 2), "it was missing"
    assert numbers.take_up("imu", 2), "of the one before it was too"
    assert not numbers.take_up("imu", 2)
    assert not numbers.take_up("imu", 0), "it had come"
    assert not numbers.take_up("speed", 0), "nobody was heard there"
    assert numbers.missing == {"imu": 2, "gnss": 2}


def test_more_holes_than_are_kept_still_count() -> None:
    numbering = Numbering("imu", 0, 0)
    for seq in range(0, 1000, 2):
        numbering.go_on(seq, 0)
    assert (len(numbering.holes), numbering.missing) == (256, 499)
    assert not numbering.fill(997 - 2 * 256, 0), "given up"
    assert numbering.fill(999 - 2 * 256, 0)


@pytest.mark.parametrize(("seq", "missing"), [(30_001, 30_000), (30_002, 0)])
def test_who_is_more_than_five_minutes_ahead_goes_on_with_another_numbering(
    seq: int, missing: int
) -> None:
    """At a hundred a second."""
    assert lost([Sent(0, 1_000, 7), Sent(seq, 2_000, 7)]) == missing


@pytest.mark.parametrize(("first", "missing"), [(64, 64), (65, 0)])
def test_another_sender_of_a_channel_that_is_heard_early_began_at_nothing(
    first: int, missing: int
) -> None:
    assert lost([*numbered(9, sender=7), *numbered(9, start=first, sender=8)]) == missing


def test_more_senders_than_are_kept_still_count_and_fill_no_memory() -> None:
    numbers = Numberings()
    for sender in range(1, 768):
        for seq in (0, 2):
            numbers.take("imu", seq, sender=sender)
        numbers.take("imu", sender - 1, sender=9_999)  # who is heard stays
    assert len(numbers.streams) == 256
    assert numbers.take("imu", 0, sender=9_999) is None
    assert numbers.published["imu"] == 4 * 767
    assert numbers.missing["imu"] == 767


def test_many_lives_of_one_that_tells_no_id_fill_no_memory() -> None:
    numbers = heard(one for life in range(50) for one in numbered(100, clock_ns=1_000 * life))
    assert len(numbers.streams) == 4
    assert (numbers.published["imu"], numbers.missing["imu"]) == (5_000, 0)


def test_numberings_survive_a_file() -> None:
    numbers = heard([*numbered(5, sender=7), Sent(2**64 - 1, 0, 7)])
    assert msgspec.json.decode(msgspec.json.encode(numbers), type=Numberings) == numbers


@given(
    st.lists(st.integers(0, 40), unique=True, max_size=30), st.sets(st.integers(0, 40), max_size=15)
)
def test_what_is_given_back_counts_as_if_it_had_not_come(seqs: list[int], back: set[int]) -> None:
    """A recorder that is killed has not written the last ones: the next one takes them again."""
    came = sorted(seqs)
    stream = Numbering("imu", 0, 0)
    for seq in came:
        stream.go_on(seq, 0)
    returned = sorted(back & set(came))
    stream.give_back(returned)

    missing = set(range(stream.next)) - (set(came) - back)
    held = [seq for begin, end in stream.holes for seq in range(begin, end)]
    assert sorted(held) == sorted(missing)
    assert held == sorted(held)
    assert stream.missing == len(missing)
    for seq in returned:
        assert stream.fill(seq, 0), "it can come again"

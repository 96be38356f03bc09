"""Where a drive stands is handed over as it changes, and what was heard once a second."""

from __future__ import annotations

from pathlib import Path

from foretwin.orchestrator.drive.handing_over import HandingOver
from foretwin.orchestrator.drive.standing import HeardStanding, heard_in, read_standing
from tests.orchestrator.drive.test_standing import watch
from tests.orchestrator.house import House


class Keeper:
    """Keeps what it is given, as the supervisor does."""

    def __init__(self) -> None:
        self.kept: list[bytes] = []

    def __call__(self, standing: bytes) -> None:
        self.kept.append(standing)

    def heard(self, at: int) -> HeardStanding:
        standing = read_standing(self.kept[at])
        assert standing is not None
        return heard_in(standing)


def test_only_what_changed_is_handed_over(tmp_path: Path) -> None:
    house, keeper = House(tmp_path), Keeper()
    standing = HandingOver(house.conductor, watch(), keep=keeper)
    standing.news()
    standing.news()
    assert len(keeper.kept) == 1
    house.conductor.rounds.dispatcher.dispatch.count.refused += 1
    standing.news()
    assert len(keeper.kept) == 2
    house.tables.close()


def test_what_was_heard_is_as_of_a_round_of_the_last_second(tmp_path: Path) -> None:
    house, keeper, now_s = House(tmp_path), Keeper(), [50.0]
    standing = HandingOver(house.conductor, watch(), keep=keeper, mono_s=lambda: now_s[0])
    rounds = house.conductor.rounds

    def received(at_s: float, *, due: int) -> int:
        """Hear one state more, hand over at a time, and return how much was heard by then."""
        house.send(house.states[len(keeper.kept)])
        house.settle()
        now_s[0], rounds.tally.due = at_s, due
        rounds.dispatcher.dispatch.count.given += 1
        standing.news()
        return keeper.heard(-1).samples.received

    first = received(50.0, due=1)
    assert received(50.5, due=2) == first, "not for each round"
    second = received(51.0, due=3)
    assert second > first
    assert received(52.5, due=3) == second, "nor between rounds"
    house.tables.close()


def test_at_the_end_everything_is_handed_over(tmp_path: Path) -> None:
    house, keeper = House(tmp_path), Keeper()
    standing = HandingOver(house.conductor, watch(), keep=keeper)
    standing.news()
    house.drive(5)
    standing.all(exit_word="completed")
    last = read_standing(keeper.kept[-1])
    assert last is not None
    assert last.exit_word == "completed"
    assert keeper.heard(-1).samples.received == house.conductor.intake.counts.received
    house.tables.close()

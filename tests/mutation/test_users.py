"""Who uses what was changed in a module."""

from __future__ import annotations

from tests.mutation.users import MOST_USERS, users_of
from tests.test_mirrored import modules

FUTURES, KEYS = "foretwin.contracts.futures", "foretwin.contracts.keys"


def changed(module: str, before: str, after: str) -> list[str]:
    text = modules()[module].read_text(encoding="utf-8")
    assert before in text
    return users_of(module, text.replace(before, after, 1))


def test_a_number_is_used_by_who_imports_it() -> None:
    used = changed(FUTURES, "CAR_WITHIN_M = 60.0", "CAR_WITHIN_M = 180.0")

    assert "foretwin.orchestrator.rounds.path_from_car" in used
    assert "foretwin.sim_worker.futures.engine_choice" not in used


def test_what_stands_within_a_module_is_used_by_who_imports_what_is_made_of_it() -> None:
    text = modules()[KEYS].read_text(encoding="utf-8")
    private = next(line for line in text.splitlines() if line.startswith("def _"))

    used = changed(KEYS, private, private.replace("def _", "def _not_"))

    assert 0 < len(used) <= MOST_USERS


def test_a_text_that_says_the_same_has_no_users() -> None:
    assert changed(FUTURES, "CAR_WITHIN_M = 60.0", "CAR_WITHIN_M = 60.0  # m") == []

"""What counts as the same, and what a difference looks like."""

from __future__ import annotations

from tests.same_bits.comparison import Section, compare, table

JOBS = {
    "round 0 job 0": {"states": "a", "valid": "b"},
    "round 0 job 1": {"states": "c", "valid": "b"},
}


def test_equal_sides_are_the_same() -> None:
    compared = compare(Section("jobs", JOBS, dict(JOBS)))

    assert compared.same
    assert len(compared.equal) == 2
    assert "different:" not in table([compared])


def test_a_changed_bit_is_named_by_its_job_and_quantity() -> None:
    head = JOBS | {"round 0 job 1": {"states": "other", "valid": "b"}}

    compared = compare(Section("jobs", JOBS, head))

    assert not compared.same
    assert compared.equal == ("round 0 job 0",)
    assert "jobs: different: round 0 job 1: states" in table([compared]).splitlines()


def test_a_job_that_one_side_did_not_do_is_a_difference() -> None:
    fewer = {"round 0 job 0": JOBS["round 0 job 0"]}

    lost, more = compare(Section("jobs", JOBS, fewer)), compare(Section("jobs", fewer, JOBS))

    assert not lost.same
    assert not more.same
    assert "jobs: base only: round 0 job 1" in table([lost]).splitlines()
    assert "jobs: head only: round 0 job 1" in table([more]).splitlines()


def test_columns_that_one_side_alone_has_are_none() -> None:
    fewer = {"round 0 job 0": JOBS["round 0 job 0"]}

    assert compare(Section("columns", JOBS, fewer, common_only=True)).same
    assert compare(Section("columns", fewer, JOBS, common_only=True)).same


def test_what_the_head_measures_more_is_told_and_what_it_no_longer_measures_is_a_difference() -> (
    None
):
    more = {key: parts | {"metric ttc": "t"} for key, parts in JOBS.items()}

    added, gone = compare(Section("jobs", JOBS, more)), compare(Section("jobs", more, JOBS))

    assert added.same
    assert "jobs: not compared, head only: metric ttc (2)" in table([added]).splitlines()
    assert not gone.same
    assert gone.different["round 0 job 0"] == ("metric ttc (gone)",)


def test_nothing_to_compare_is_not_the_same() -> None:
    assert not compare(Section("jobs", {}, {})).same
    assert not compare(Section("columns", {"a": {}}, {"b": {}}, common_only=True)).same


def test_of_many_differences_the_first_are_shown() -> None:
    base = {f"job {number}": {"states": "a"} for number in range(20)}
    head = {f"job {number}": {"states": "b"} for number in range(20)}

    told = table([compare(Section("jobs", base, head))]).splitlines()

    assert [line.split()[3] for line in told if "different:" in line] == [
        "0:",
        "1:",
        "2:",
        "3:",
        "4:",
    ]

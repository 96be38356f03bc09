"""What of two machines may make other bits is named."""

from __future__ import annotations

import msgspec
import pytest

from foretwin.contracts.fleet import MachineInfo
from foretwin.orchestrator.record.machine import differences, other_arithmetic, this_machine

OURS = MachineInfo(
    cores=2, cpu="AMD EPYC", versions={"numpy": "2.3.5", "numba": "0.62"}, arithmetic={"sin": "a"}
)


def test_this_machine_is_the_same_as_itself() -> None:
    here = this_machine()
    assert here.cores >= 1
    assert here.versions["foretwin"]
    assert "are said to be the same" in differences(here, this_machine())


@pytest.mark.parametrize(
    ("theirs", "text"),
    [
        ({"versions": {"numpy": "2.4.0", "numba": "0.62"}}, "numpy 2.4.0 there, 2.3.5 here"),
        ({"versions": {"numpy": "2.3.5"}}, "numba missing there, 0.62 here"),
        ({"cpu": "Ryzen 9"}, "Ryzen 9 there, AMD EPYC here"),
        ({"cores": 16}, "versions and processor (AMD EPYC) are said to be the same"),
    ],
)
def test_differences_name_both(theirs: dict[str, object], text: str) -> None:
    assert differences(msgspec.structs.replace(OURS, **theirs), OURS) == text


def test_functions_that_come_to_other_bits_are_named() -> None:
    assert other_arithmetic(OURS, OURS) == ()
    for theirs in ({"sin": "b"}, {}):
        assert other_arithmetic(msgspec.structs.replace(OURS, arithmetic=theirs), OURS) == ("sin",)

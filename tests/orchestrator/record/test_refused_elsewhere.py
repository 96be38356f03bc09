"""What other processes have refused, as run.json and the screen tell it."""

from __future__ import annotations

from pathlib import Path

from foretwin.contracts.refusal_counts import OwnRefusals, RefusalFile, RefusedKind
from foretwin.orchestrator.record.refused_elsewhere import lines_to_tell, refused_elsewhere

SPEED = "foretwin/v1/vehicle/ego/telemetry/speed"


def write(folder: Path, process_id: str, *kinds: RefusedKind, counted_all: bool = True) -> None:
    RefusalFile(folder, process_id).write(OwnRefusals(kinds=kinds, counted_all=counted_all))


def kind(sender: str, reason: str, key: str = "", count: int = 1) -> RefusedKind:
    return RefusedKind(sender=sender, reason=reason, key=key, count=count)


def test_the_router_is_told_by_role_and_others_by_process(tmp_path: Path) -> None:
    said = kind("worker-w0", "say", SPEED, 3)
    write(tmp_path, "router", said, kind("", "no password", count=2), counted_all=False)
    write(tmp_path, "ros2", kind("run/r/authority", "not signed", count=4))

    assert refused_elsewhere(tmp_path) == {
        "refused_by_router": {
            "count": 5,
            "counted_all": False,
            "by_role": [
                {"role": None, "name": "", "kind": "no password", "key": "", "count": 2},
                {"role": "worker", "name": "worker-w0", "kind": "say",
                 "key": "vehicle/ego/telemetry/speed", "count": 3},
            ],
        },
        "refused_by_processes": {
            "count": 4,
            "by_process": [
                {"process": "ros2", "sender": "run/r/authority", "reason": "not signed",
                 "count": 4},
            ],
        },
    }  # fmt: skip
    assert [line.text for line in lines_to_tell(tmp_path)] == [
        "refused: ros2: run/r/authority: not signed; more of the kind are counted",
        "refused: the router did not let in somebody: no password; more of the kind are counted",
        "refused: worker-w0 may not say vehicle/ego/telemetry/speed; more of the kind are counted",
        "not all that router said of refusals could be read: run.json tells the least",
    ]


def test_a_long_key_is_told_in_part(tmp_path: Path) -> None:
    write(tmp_path, "router", kind("viewer", "say", "x" * 199))
    (line,) = lines_to_tell(tmp_path)
    assert len(line.text) < 200


def test_nothing_refused_is_said_too(tmp_path: Path) -> None:
    assert refused_elsewhere(tmp_path) == {
        "refused_by_router": {"count": 0, "counted_all": True, "by_role": []},
        "refused_by_processes": {"count": 0, "by_process": []},
    }

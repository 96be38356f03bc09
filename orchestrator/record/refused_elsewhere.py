"""What other processes of a run have refused, for its record and to be told: the router by rules,
passwords and certificates, any other one of what came to it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from foretwin.contracts.access import role_of
from foretwin.contracts.keys import PREFIX
from foretwin.contracts.refusal_counts import OwnRefusals, RefusedKind, refused_by

ROUTER = "router"
_MOST_TOLD = 120
"""Letters of a key; the record has more."""


class Told(NamedTuple):
    """Refusals of one kind, to be told once, and the line that tells them.

    What several processes hear alike is one kind.
    """

    by_router: bool
    sender: str
    reason: str
    text: str


def refused_elsewhere(processes: Path) -> dict[str, Any]:
    """Return the parts of run.json that follow from what processes wrote into their folder."""
    found = refused_by(processes)
    router = found.pop(ROUTER, OwnRefusals())
    return {
        "refused_by_router": {
            "count": router.count,
            "counted_all": router.counted_all,
            "by_role": [
                {
                    "role": role_of(one.sender),
                    "name": one.sender,
                    "kind": one.reason,
                    "key": _short(one.key),
                    "count": one.count,
                }
                for one in router.kinds
            ],
        },
        "refused_by_processes": {
            "count": sum(each.count for each in found.values()),
            "by_process": [
                {"process": name, "sender": one.sender, "reason": one.reason, "count": one.count}
                for name, each in sorted(found.items())
                for one in each.kinds
            ],
        },
    }


def lines_to_tell(processes: Path) -> Iterator[Told]:
    """Yield a line for each kind of refusal that processes have written of."""
    for name, refused in refused_by(processes).items():
        for one in refused.kinds:
            by_router = name == ROUTER
            text = _of_router(one) if by_router else f"{name}: {one.sender}: {one.reason}"
            line = f"refused: {text}; more of the kind are counted"
            yield Told(by_router, one.sender, one.reason, line)
        if not refused.counted_all:
            text = f"not all that {name} said of refusals could be read: run.json tells the least"
            yield Told(True, "", "more than can be counted", text)


def _of_router(one: RefusedKind) -> str:
    if not one.key:
        whom = one.sender or "somebody"
        return f"the router did not let in {whom}: {one.reason}"
    whom = one.sender or "somebody whose name is not known any more"
    return f"{whom} may not {one.reason} {_short(one.key)[:_MOST_TOLD]}"


def _short(key: str) -> str:
    return key.removeprefix(f"{PREFIX}/")

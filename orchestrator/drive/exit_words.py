"""How a drive ended: the `exit` of run.json, and the exit code that fits."""

from __future__ import annotations

from foretwin.contracts.exit_codes import DONE, INTERNAL, INTERRUPTED, PARTLY

VEHICLE_ENDED = "vehicle_ended"
"""The vehicle's process died: what came before is kept."""
IN_ORDER = ("completed", VEHICLE_ENDED)
"""Everybody gets the time to write what there is."""
EXIT_DONE, EXIT_FAILED, EXIT_PARTLY, EXIT_INTERRUPTED = DONE, INTERNAL, PARTLY, INTERRUPTED
_CODES = {
    "completed": EXIT_DONE,
    VEHICLE_ENDED: EXIT_PARTLY,
    "interrupted": EXIT_INTERRUPTED,
    "failed": EXIT_FAILED,
}


def exit_code(word: str, *, whole: bool) -> int:
    """Return the exit code of a drive that ended so; `whole`: nothing of it is lost."""
    code = _CODES[word]
    return EXIT_PARTLY if code == EXIT_DONE and not whole else code

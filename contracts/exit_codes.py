"""What a command's exit code says, in one table."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

DONE, INTERNAL, USER, PARTLY, INTERRUPTED = 0, 1, 2, 3, 130
EXIT_CODES: Mapping[int, str] = MappingProxyType(
    {
        DONE: "done",
        INTERNAL: "an internal error, which a line names with the file of its traceback; also a "
        "drive that failed",
        USER: "something that the user can mend: one line names the option, or the file, its line "
        "and key, and what would be right",
        PARTLY: "done, but part of it failed, is missing or differs; a line says what",
        INTERRUPTED: "interrupted by Ctrl-C, SIGTERM or a closed terminal, with everything put "
        "away",
    }
)
"""Every exit code of `foretwin`."""

"""Letters that cannot be shown: one mark for each run of them, in pictures and in the viewer."""

from __future__ import annotations

import re
from collections.abc import Iterable

LEFT_OUT = "…"


def without(text: str, missing: Iterable[str]) -> str:
    """Return the text with a mark for each run of the letters that cannot be shown."""
    letters = "".join(map(re.escape, sorted(missing)))
    return re.sub(rf"[{letters}](?:[^\S\n]*[{letters}])*", LEFT_OUT, text) if letters else text

"""Whether a drive watches its vehicle, where nobody has said so: by processors and workers."""

from __future__ import annotations

from typing import Literal, NamedTuple

Tuning = Literal["off", "report", "apply"]


class TuningChoice(NamedTuple):
    """What is done, and why in a few words."""

    mode: Tuning
    why: str

    @property
    def text(self) -> str:
        """The choice as one line."""
        return f"tuning {self.mode}: {self.why}"


def choose_tuning(
    asked: Tuning | None, *, lock_step: bool, workers: int, processors: int
) -> TuningChoice:
    """Return what the user asked for, else `report` where workers have a processor each.

    It gives way to them and takes what they leave; where they have to share processors already,
    nothing is left. In lock step nothing can be late, and findings must not depend on the machine.
    """
    if asked is not None:
        return TuningChoice(asked, "as was asked for")
    if lock_step:
        return TuningChoice("report", "in lock step nothing can be late")
    has = f"{processors} processor" if processors == 1 else f"{processors} processors"
    needs = f"{workers} worker" if workers == 1 else f"{workers} workers"
    if processors >= workers:
        return TuningChoice("report", f"{has} for {needs}, to whom it gives way")
    return TuningChoice("off", f"{has} for {needs} leave none over (--tuning report has it)")

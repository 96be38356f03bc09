"""What became of the vehicle's telemetry in one run: published = recorded + lost."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from foretwin.contracts.keys import SAMPLE_CHANNELS
from foretwin.contracts.tally import Tally


def telemetry_ledger(tally: Tally | None, published: Mapping[str, int]) -> dict[str, Any]:
    """Return run.json's `ledger.telemetry`, in samples.

    `tally` is the recorder's; `published` is what others know of by channel: the vehicle by its
    own count, or the orchestrator by what it heard. What a recorder that had ended did not hear
    never came to it.
    """
    tally = tally or Tally()
    known, missing = tally.numbers.published, tally.numbers.missing
    lost_by = {
        "never_came": sum(
            missing[name] + max(0, published.get(name, 0) - known[name]) for name in SAMPLE_CHANNELS
        ),
        "unwritten": sum(tally.unwritten.get(name, 0) for name in SAMPLE_CHANNELS),
        "refused": sum(tally.refused.get(name, 0) for name in SAMPLE_CHANNELS),
    }
    return {
        "published": sum(max(published.get(name, 0), known[name]) for name in SAMPLE_CHANNELS),
        "recorded": sum(tally.recorded.get(name, 0) for name in SAMPLE_CHANNELS),
        "lost": sum(lost_by.values()),
        "lost_by": lost_by,
    }


_WORDS = {
    "never_came": "never came to the recorder",
    "unwritten": "could not be written",
    "refused": "fit no recording",
}


def lost_telemetry_line(ledger: Mapping[str, Any]) -> str | None:
    """Return what the engineer reads of lost telemetry, None where none is lost."""
    if not ledger["lost"]:
        return None
    reasons = ", ".join(
        f"{count} {_WORDS[reason]}" for reason, count in ledger["lost_by"].items() if count
    )
    return (
        f"{ledger['lost']} of {ledger['published']} telemetry samples are not recorded: {reasons}"
    )

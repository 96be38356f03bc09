"""What a recorder that is gone has recorded: its tally, and what its files hold besides."""

from __future__ import annotations

import contextlib
import itertools
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from foretwin.contracts.numbering import Numberings
from foretwin.contracts.segments import number_of, segments_of
from foretwin.contracts.tally import Tally, read_tally, tally_file
from foretwin.telemetry.logs.log import LogError
from foretwin.telemetry.logs.mcap_records import Record, in_file_order
from foretwin.telemetry.ros_messages.table import channel_of


def tally_left(path: Path, *, no_more_than_held: bool = False) -> Tally:
    """Return the tally that another recorder left, with what lies in its files since.

    After a power cut a tally may count what never came to the disk: `no_more_than_held` counts all
    that the files hold, and takes what is more as unwritten.
    """
    tally = read_tally(tally_file(path)) or Tally()
    for part in segments_of(path):
        number = number_of(path, part) or 0
        if number < tally.part:
            continue
        found = ((channel_of(one.topic), one) for one in in_file_order(part))
        known = tally.in_part if number == tally.part else 0
        with contextlib.suppress(LogError, OSError):  # then what it holds is taken again
            samples = ((channel, one) for channel, one in found if channel is not None)
            for channel, one in itertools.islice(samples, known, None):
                if _had_not_come(tally.numbers, channel, one):
                    tally.settle("recorded", channel)
    if no_more_than_held:
        held = Counter(channel_of(one.topic) for one in _records(path))
        for channel, count in tally.recorded.items():
            missing = max(0, count - held[channel])
            tally.recorded[channel] = count - missing
            tally.unwritten[channel] = tally.unwritten.get(channel, 0) + missing
    return tally


def _had_not_come(numbers: Numberings, channel: str, one: Record) -> bool:
    if one.sender:
        return numbers.take(channel, one.sequence, sender=one.sender) is not None
    return numbers.take_up(channel, one.sequence)


def _records(path: Path) -> Iterator[Record]:
    for part in segments_of(path):
        with contextlib.suppress(LogError, OSError):
            yield from in_file_order(part)

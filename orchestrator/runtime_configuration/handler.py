"""The table of what can be changed in a running drive, and the changes asked for and made."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple, Protocol

from foretwin.contracts.errors import UserError, one_line
from foretwin.contracts.guard import Refused
from foretwin.contracts.mailbox import Request
from foretwin.contracts.running import MOST_LISTED, FirstOf
from foretwin.contracts.tuning import SetReply, SetRequest

NOT_TO_BE_SET = "a change that cannot be made"


class RefusedError(UserError):
    """A change that cannot be made; the message says in one line what could be."""


class Made(NamedTuple):
    """What a handler changed: the value that counted before, and the one that counts now."""

    before: str
    value: str


class ChangeHandler(Protocol):
    """Makes the changes of one kind of key, such as `role.ID`; see RuntimeConfiguration."""

    @property
    def keys(self) -> str:
        """How its keys look, for those who asked for another."""

    @property
    def at_once(self) -> bool:
        """Whether its changes do not wait for the end of the round in progress."""

    def check(self, name: str, value: str) -> None:
        """Raise RefusedError where `value` cannot be given to `name`, the key after its dot."""

    def make(self, name: str, value: str, *, stamp_ns: int) -> Made:
        """Let the value count from `stamp_ns` on; raises RefusedError where it no longer can."""


class Change(NamedTuple):
    """A change that was made; `stamp_ns` is the first stamp of the vehicle for which it counts."""

    stamp_ns: int
    asked_stamp_ns: int
    key: str
    before: str
    value: str

    @property
    def text(self) -> str:
        """Return what was changed, in a few words."""
        return f"{self.key}: {self.before} -> {self.value}"

    def row(self) -> dict[str, Any]:
        """Return the row of the table `changes`."""
        return self._asdict()


class _Waiting(NamedTuple):
    request: Request
    asked: SetRequest
    asked_stamp_ns: int


class RuntimeConfiguration:
    """Takes questions of the channel `set`, refuses what makes no sense, and lets the rest wait.

    `make` is called between two rounds, so that no round is half of one kind and half of another,
    and during one for changes that no round in progress is told of.
    A handler stands in the table under the part of its keys before the first dot.
    """

    def __init__(self, handlers: Mapping[str, ChangeHandler]) -> None:
        self._handlers = dict(handlers)
        self._waiting: list[_Waiting] = []
        self.made: FirstOf[Change] = FirstOf(MOST_LISTED)
        """The changes of the drive, in order."""

    @property
    def waiting(self) -> bool:
        """Whether a change has been asked for and is not made yet."""
        return bool(self._waiting)

    def take(self, request: Request, *, stamp_ns: int) -> None:
        """Let a question wait for `make`, or answer at once that it cannot be done.

        Raises Refused, once it has been answered, for what the guard does not let in, and for what
        cannot be set.
        """
        try:
            asked: SetRequest = request.message()
        except Refused as refused:
            request.refuse(one_line(refused))
            raise
        try:
            prefix, name = self._split(asked.key)
            self._handlers[prefix].check(name, asked.value)
        except RefusedError as refused:
            request.reply(SetReply(done=False, text=str(refused)))
            raise Refused(request.key, NOT_TO_BE_SET, str(refused)) from refused
        self._waiting.append(_Waiting(request, asked, stamp_ns))

    def make(
        self, *, stamp_ns: int, start_stamp_ns: int, between_rounds: bool = True
    ) -> list[Change]:
        """Make what waits, in the order in which it was asked for, and answer; returns what was."""
        everything, self._waiting = self._waiting, []
        waiting: list[_Waiting] = []
        for one in everything:
            now = between_rounds or self._handlers[self._split(one.asked.key)[0]].at_once
            (waiting if now else self._waiting).append(one)
        changes = []
        for request, asked, asked_stamp_ns in waiting:
            prefix, name = self._split(asked.key)
            try:
                made = self._handlers[prefix].make(name, asked.value, stamp_ns=stamp_ns)
            except RefusedError as refused:
                request.reply(SetReply(done=False, text=str(refused)))
                continue
            change = Change(stamp_ns, asked_stamp_ns, asked.key, made.before, made.value)
            changes.append(change)
            at_s = (stamp_ns - start_stamp_ns) / 1e9
            text = f"{change.text}, from {at_s:.2f} s of the drive on"
            request.reply(SetReply(done=True, text=text))
        self.made.extend(changes)
        return changes

    def refuse_all(self, reason: str) -> None:
        """Answer what still waits: it will not be done."""
        for request, _, _ in self._waiting:
            request.reply(SetReply(done=False, text=reason))
        self._waiting = []

    def record(self, start_stamp_ns: int) -> list[dict[str, Any]]:
        """Return the `changes` of run.json."""
        return [
            {"drive_time_s": (change.stamp_ns - start_stamp_ns) / 1e9, **change.row()}
            for change in self.made
        ]

    def _split(self, key: str) -> tuple[str, str]:
        prefix, _, name = key.partition(".")
        if prefix not in self._handlers:
            known = ", ".join(handler.keys for handler in self._handlers.values())
            raise RefusedError(f"{key}: unknown key; can be set: {known}")
        return prefix, name

"""What a router turns away, read out of its own log: Zenoh 1.10 tells it nowhere else.

Access rules are told at TRACE, passwords at DEBUG, certificates at WARN. A record is one line of
text, which a key can hold line breaks in: records must come apart (see own_log).
"""

from __future__ import annotations

import re
import threading
from collections import deque
from collections.abc import Iterator

from foretwin.contracts.lives import life_of_key
from foretwin.contracts.refusal_counts import OwnRefusals, RefusalCounts

_RULES = "zenoh::net::routing::interceptor::access_control"
_HANDSHAKE = "zenoh_transport::unicast::establishment::accept"
FILTER = f"warn,{_RULES}=trace,{_HANDSHAKE}=debug"
"""For RUST_LOG."""
MOST_SESSIONS = 1000
"""So many are known by name; who connects again and again fills no memory."""
_MOST_PASSED_ON = 100
"""Warnings and errors that are no refusals, in all: they go to the run's log."""

_RECORD = re.compile(rb"\S+Z +([A-Z]+) +(?:\S+ +)?ThreadId\((\d+)\) ([\w:]+): (.*)", re.DOTALL)
_ALLOWED = re.compile(
    rb"\S+Z TRACE +(?:\S+ +)?ThreadId\((\d+)\) " + _RULES.encode()
    + rb": Using cached result: [0-9a-f]+ is authorized to "
)  # fmt: skip
"""By far the most records; a key comes after all of this."""
_CACHED = re.compile(
    rb"Using cached result: ([0-9a-f]+) is unauthorized to (.+?) \((in|e)gress\) on (.*)",
    re.DOTALL,
)
_DECIDED = re.compile(
    rb"([0-9a-f]+) on (.+?) (is authorized|is unauthorized|has an authorization error) to "
    rb"(.+?) \((in|e)gress\) on (.*)",
    re.DOTALL,
)
_LOOKS_AHEAD = b"ACL (ingress): caching permissions for `"
_LOOKS = frozenset(
    {b"Query", b"Reply", b"Put", b"Delete", b"Declare/Undeclare Subscriber",
     b"Declare/Undeclare Queryable", b"Declare/Undeclare Liveliness Token", b"Liveliness Query",
     b"Declare Liveliness Subscriber"}
)  # fmt: skip
_MOST_KEY = 200
"""So much of a key is compared; a record may have been cut after more."""
_NO_SUBJECT = re.compile(rb"([0-9a-f]+) did not match any configured ACL subject")
_NAME = re.compile(rb"(?:Username|CertCommonName)\((.*?)\)(?=\+|$)")

_IS_ALIVE = "be alive as"
_DOES = {
    "Put": "say",
    "Delete": "delete",
    "Query": "ask",
    "Reply": "answer",
    "Declare Subscriber": "hear",
    "Declare Queryable": "serve",
    "Liveliness Token": _IS_ALIVE,
    "Declare Liveliness Token": _IS_ALIVE,
    "Liveliness Query": "see who is",
    "Declare Liveliness Subscriber": "watch who is",
}
"""What somebody wanted to do, by Zenoh's word for it."""
NO_RULE = "no rule is for its name"
_PASSWORDS = {
    b"Expected extension": "no password",
    b"Invalid password": "a wrong password",
    b"Invalid user": "an unknown name",
}
_CERTIFICATES = {
    b"peer sent no certificates": "no certificate",
    b"certificate expired": "an expired certificate",
    b"not valid yet": "a certificate that is not valid yet",
    b"extended key usage": "a certificate that is no client's",
    b"invalid peer certificate": "another campaign's certificate",
    b"corrupt message": "no TLS",
}
"""Why somebody came no further than its handshake, by what Zenoh's words hold; in order."""
UNFINISHED = "an unfinished handshake"
_HUNG_UP = re.compile(rb"(?:Read|Write) error on ")
"""Who has gone before it was answered was turned away by nobody: a process of ours on a slow
machine hangs up when its time to connect is over, and calls again."""
_ONLY_KNOCKED = b"tls handshake eof"
"""As those do whose link to the router was cut; see foretwin.contracts.redialled_bus."""


class RouterLog:
    """Counts by name and by what was refused; keeps the first lines that tell something else.

    One thread takes records, another one asks. Whose handshake failed nobody knows.
    """

    def __init__(self) -> None:
        self._others: deque[str] = deque()
        self._others_left = _MOST_PASSED_ON
        self._counts, self._counting = RefusalCounts(), threading.Lock()
        self._counted_all = True
        self._names: dict[bytes, str] = {}
        self._looking_ahead: dict[bytes, list[bytes]] = {}
        """By thread, a key and what was asked of it: before a session says anything on a key, all
        that it might do there is looked up."""
        self._unsure_but: set[bytes] | None = None
        """After a gap, the threads of which it is known again where they are."""

    def take(self, record: bytes) -> None:
        """Take one record."""
        allowed = _ALLOWED.match(record)
        if allowed is not None:
            if self._unsure_but is not None:
                self._sure_of(allowed[1])
            return None
        found = _RECORD.fullmatch(record.rstrip(b"\n"))
        if found is None:
            return self._other(record)
        level, thread, target, text = found.groups()
        if target == _RULES.encode():
            self._rule(thread, text)
        elif target == _HANDSHAKE.encode():
            self._handshake(text)
        elif b"tls" in target and (why := _word(_CERTIFICATES, text)) is not None:
            self._count("", why)
        elif level in (b"WARN", b"ERROR") and not text.startswith(_ONLY_KNOCKED):
            self._other(record)
        return None

    def gap(self) -> None:
        """Say that records are missing from here on."""
        self._counted_all = False
        self._looking_ahead.clear()
        self._unsure_but = set()

    def counted(self) -> OwnRefusals:
        """Return what was turned away so far."""
        with self._counting:
            return OwnRefusals(kinds=self._counts.kinds(), counted_all=self._counted_all)

    def others(self) -> Iterator[str]:
        """Yield warnings and errors that came since, each once, and of too many the first."""
        while self._others:
            yield self._others.popleft()

    def _rule(self, thread: bytes, text: bytes) -> None:
        if text.startswith(_LOOKS_AHEAD):
            self._sure_of(thread)
            key = text.removeprefix(_LOOKS_AHEAD).removesuffix(b"` ...")
            self._looking_ahead[thread] = [key[:_MOST_KEY]]
        elif (decided := _DECIDED.fullmatch(text)) is not None:
            session, subject, verdict, does, flow, key = decided.groups()
            name = self._name(session, subject)
            looks = flow != b"in" or self._only_looks(thread, does, subject, key)
            if not looks and verdict != b"is authorized" and self._is_sure_of(thread):
                self._refused(name, does, key)
        elif (cached := _CACHED.fullmatch(text)) is not None:
            self._sure_of(thread)
            session, does, flow, key = cached.groups()
            if flow == b"in":
                self._refused(self._names.get(session, ""), does, key)
        elif _NO_SUBJECT.match(text):
            self._count("", NO_RULE)

    def _only_looks(self, thread: bytes, does: bytes, subject: bytes, key: bytes) -> bool:
        """Whether a decision is one of those taken ahead, all in one go on one thread."""
        ahead = self._looking_ahead.get(thread)
        if ahead is None:
            return False
        step = does + b" " + subject
        if does not in _LOOKS or key[:_MOST_KEY] != ahead[0] or step in ahead:
            del self._looking_ahead[thread]
            return False
        ahead.append(step)
        return True

    def _sure_of(self, thread: bytes) -> None:
        self._looking_ahead.pop(thread, None)
        if self._unsure_but is not None:
            self._unsure_but.add(thread)

    def _is_sure_of(self, thread: bytes) -> bool:
        return self._unsure_but is None or thread in self._unsure_but

    def _name(self, session: bytes, subject: bytes) -> str:
        if session not in self._names:
            if len(self._names) >= MOST_SESSIONS:
                del self._names[next(iter(self._names))]
            found = _NAME.search(subject)
            self._names[session] = found[1].decode(errors="replace") if found else ""
        return self._names[session]

    def _refused(self, name: str, does: bytes, key: bytes) -> None:
        word = does.decode(errors="replace").removeprefix("Declare/Undeclare ")
        if not word.startswith("Undeclare"):  # of what was refused when it was declared
            word = word if word in _DOES else f"Declare {word}"
            what, full_key = _DOES.get(word, word), key.decode(errors="replace")
            if what == _IS_ALIVE:
                alive_key, life = life_of_key(full_key)
                if "/" not in life:  # else it is no life, and told as it was tried
                    full_key = alive_key
            self._count(name, what, full_key)

    def _handshake(self, text: bytes) -> None:
        if (why := _word(_PASSWORDS, text)) is not None:
            self._count("", why)
        elif not (text.startswith(b"New transport link accepted") or _HUNG_UP.match(text)):
            self._count("", UNFINISHED)

    def _count(self, name: str, what: str, key: str = "") -> None:
        with self._counting:
            self._counts.add(name, what, key=key)

    def _other(self, record: bytes) -> None:
        if self._others_left:
            self._others_left -= 1
            self._others.append(record.decode(errors="replace").rstrip("\n"))


def _word(meanings: dict[bytes, str], text: bytes) -> str | None:
    return next((word for said, word in meanings.items() if said in text), None)

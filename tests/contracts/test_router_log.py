"""What a router's log tells of refusals; tests/contracts/test_router.py has a real router's."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from foretwin.contracts.refusal_counts import RefusedKind
from foretwin.contracts.router_log import NO_RULE, UNFINISHED, RouterLog

RULES = "zenoh::net::routing::interceptor::access_control"
ACCEPT = "zenoh_transport::unicast::establishment::accept"
LOOKS = (
    "Query", "Reply", "Put", "Delete", "Declare/Undeclare Subscriber",
    "Declare/Undeclare Queryable", "Declare/Undeclare Liveliness Token", "Liveliness Query",
    "Declare Liveliness Subscriber",
)  # fmt: skip
SPEED, MINE = "foretwin/v1/vehicle/ego/telemetry/speed", "foretwin/v1/run/r1/mirror"


def record(text: str, *, target: str = RULES, level: str = "TRACE", thread: int = 8) -> bytes:
    line = f"2026-11-22T23:35:44.005647Z {level:>5}  rx-0 ThreadId({thread:02}) {target}: {text}\n"
    return line.encode()


def subject(name: str, session: str) -> str:
    if name in ("car", "worker"):
        return f"Interface(lo)+CertCommonName({name})+Transport(Tls)+{session}"
    return f"Username({name})+Transport(UnixsockStream)+{session}"


def decided(
    does: str, key: str, *, name: str = "worker-w0", may: bool = False, session: str = "ca80",
    flow: str = "ingress", thread: int = 8,
) -> bytes:  # fmt: skip
    word = "authorized" if may else "unauthorized"
    who = f"{session} on {subject(name, session)}"
    return record(f"{who} is {word} to {does} ({flow}) on {key}", thread=thread)


def cached(does: str, key: str, *, may: bool = False, session: str = "ca80") -> bytes:
    word = "authorized" if may else "unauthorized"
    return record(f"Using cached result: {session} is {word} to {does} (ingress) on {key}")


def looks_ahead(key: str, *, thread: int = 8, may: str = "Put") -> list[bytes]:
    """What stands there before a session first speaks on a key that it has declared."""
    head = record(f"ACL (ingress): caching permissions for `{key}` ...", thread=thread)
    return [head, *(decided(does, key, may=does == may, thread=thread) for does in LOOKS)]


def counted(*records: bytes) -> dict[tuple[str, str, str], int]:
    log = RouterLog()
    for one in records:
        log.take(one)
    return {(one.sender, one.reason, one.key): one.count for one in log.counted().kinds}


def test_what_is_looked_up_ahead_is_no_refusal() -> None:
    assert counted(*looks_ahead(MINE), cached("Put", MINE, may=True)) == {}


def test_what_is_said_against_the_rules_is_counted_by_name_and_key() -> None:
    said = [*looks_ahead(SPEED, may=""), *(cached("Put", SPEED) for _ in range(3))]
    assert counted(*said) == {("worker-w0", "say", SPEED): 3}


def test_what_was_never_declared_is_decided_each_time() -> None:
    found = counted(
        decided("Put", SPEED), decided("Put", SPEED), decided("Declare Subscriber", "**"),
        decided("Delete", MINE, name="viewer", session="77"), decided("Put", MINE, may=True),
    )  # fmt: skip
    assert found == {
        ("worker-w0", "say", SPEED): 2,
        ("worker-w0", "hear", "**"): 1,
        ("viewer", "delete", MINE): 1,
    }


def test_a_refusal_right_after_a_look_ahead_counts() -> None:
    for after in ("Put", "Declare Subscriber", "Declare Liveliness Subscriber"):
        found = counted(*looks_ahead(SPEED, may=""), decided(after, SPEED))
        assert sum(found.values()) == 1, after


def test_threads_look_ahead_beside_each_other() -> None:
    pairs = zip(looks_ahead(SPEED, thread=8), looks_ahead(MINE, thread=9), strict=True)
    assert counted(*itertools.chain(*pairs), decided("Put", SPEED, thread=10)) == {
        ("worker-w0", "say", SPEED): 1
    }


def test_a_session_of_many_interfaces_looks_ahead_by_each() -> None:
    head, *looks = looks_ahead(SPEED, may="")
    both = [(one, one.replace(b"Username", b"Interface(eth1)+Username")) for one in looks]
    assert counted(head, *itertools.chain(*both)) == {}


def test_what_passes_on_to_somebody_is_nobodys_refusal() -> None:
    assert counted(decided("Put", SPEED, flow="egress")) == {}


@pytest.mark.parametrize(
    ("does", "word"),
    [
        ("Query", "ask"), ("Reply", "answer"), ("Declare Queryable", "serve"),
        ("Liveliness Token", "be alive as"), ("Declare Liveliness Token", "be alive as"),
        ("Liveliness Query", "see who is"), ("Declare Liveliness Subscriber", "watch who is"),
    ],
)  # fmt: skip
def test_all_that_somebody_may_not_do_has_a_word(does: str, word: str) -> None:
    assert counted(decided(does, MINE)) == {("worker-w0", word, MINE): 1}


@pytest.mark.parametrize(
    ("token", "told"),
    [
        ("run/r1/alive/w0/00a1-b2", "run/r1/alive/w0"),
        ("run/r1/alive/w0", "run/r1/alive/w0"),
        ("run/r1/alive/../../etc/passwd", "run/r1/alive/../../etc/passwd"),
    ],
)
def test_all_lives_of_a_process_are_one_and_a_path_is_told_as_it_was_tried(
    token: str, told: str
) -> None:
    refused = counted(decided("Liveliness Token", f"foretwin/v1/{token}"))
    assert refused == {("worker-w0", "be alive as", f"foretwin/v1/{told}"): 1}


def test_a_name_without_rules_is_counted() -> None:
    text = "ca80 did not match any configured ACL subject. Default permission `Deny` will be …"
    assert counted(record(text, level="INFO")) == {("", NO_RULE, ""): 1}


def test_certificates_tell_the_role() -> None:
    assert counted(decided("Put", SPEED, name="worker")) == {("worker", "say", SPEED): 1}


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("UsrPwd extension - Recv InitSyn. Expected extension. at usrpwd.rs:380.", "no password"),
        ("UsrPwd extension - Recv OpenSyn. Invalid password. at u.rs:424.", "a wrong password"),
        ("UsrPwd extension - Recv OpenSyn. Invalid user. at u.rs:418.", "an unknown name"),
        (
            "Decode error on link: unixsock-stream/bus => unixsock-stream/75 at l.rs:331.",
            UNFINISHED,
        ),
    ],
)
def test_handshakes_that_fail_are_counted_by_why(text: str, why: str) -> None:
    assert counted(record(text, target=ACCEPT, level="DEBUG")) == {("", why, ""): 1}


@pytest.mark.parametrize(
    "why",
    [
        "Read error on UnixSocketStream link bus => 4e80: early eof at unicast.rs:113.",
        "Write error on UnixSocketStream link bus => f282: Broken pipe (os error 32) at u.rs:93.",
        "Read error on TLS link: peer closed connection without sending TLS close_notify",
    ],
)
def test_who_hangs_up_is_refused_by_nobody(why: str) -> None:
    assert counted(record(why, target=ACCEPT, level="DEBUG")) == {}


def test_one_that_is_let_in_is_no_refusal() -> None:
    text = "New transport link accepted from 6f to 52: Link { src: Invalid-password }"
    assert counted(record(text, target=ACCEPT, level="DEBUG")) == {}


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("peer sent no certificates", "no certificate"),
        ("invalid peer certificate: UnknownIssuer", "another campaign's certificate"),
        ("invalid peer certificate: certificate expired: …", "an expired certificate"),
        ("received corrupt message of type InvalidContentType", "no TLS"),
        ("invalid peer certificate: certificate does not allow extended key usage for client",
         "a certificate that is no client's"),
    ],
)  # fmt: skip
def test_certificates_that_are_not_taken_are_counted_by_why(text: str, why: str) -> None:
    line = record(f"{text}. Hint: …", target="zenoh_link_tls::unicast", level="WARN")
    assert counted(line) == {("", why, ""): 1}


def test_who_only_knocks_is_not_told_of() -> None:
    text = "tls handshake eof. Hint: increase the system open file limit."
    log = RouterLog()
    log.take(record(text, target="zenoh_link_tls::unicast", level="WARN"))
    assert (list(log.others()), log.counted().kinds) == ([], ())


def test_nobody_says_it_in_anothers_name() -> None:
    """A key may hold line breaks, and what follows one looks like the log."""
    forged = decided("Put", SPEED, name="orchestrator", session="0a").decode()
    key = f"foretwin/v1/x\n{forged}"
    found = counted(decided("Put", key, name="viewer"), cached("Put", key))
    assert {name for name, _, _ in found} == {"viewer"}
    assert sum(found.values()) == 2


def test_a_key_that_looks_allowed_is_refused_all_the_same() -> None:
    key = "foretwin/v1/x is authorized to Put (ingress) on y"
    assert counted(*looks_ahead(MINE), cached("Put", key), decided("Put", key)) == {
        ("worker-w0", "say", key): 2
    }


def test_a_long_key_that_was_cut_is_looked_ahead_too() -> None:
    key = f"{MINE}/{'x' * 5000}"
    cut = [one[:1024] for one in (*looks_ahead(key, may=""), cached("Put", key))]
    assert list(counted(*cut).values()) == [1]


def test_after_a_gap_nothing_is_counted_that_may_be_a_look_ahead() -> None:
    log = RouterLog()
    assert log.counted().counted_all
    log.gap()
    for one in looks_ahead(SPEED, may="")[3:]:
        log.take(one)
    assert log.counted().kinds == ()
    assert not log.counted().counted_all
    log.take(cached("Put", SPEED))
    log.take(decided("Put", MINE))
    assert log.counted().count == 2

    log.gap()
    log.take(decided("Put", MINE))
    assert log.counted().count == 2
    log.take(cached("Put", MINE, may=True))
    log.take(decided("Put", MINE))
    assert log.counted().count == 3


def test_who_connects_again_and_again_fills_no_memory() -> None:
    log = RouterLog()
    for session in range(1010):
        log.take(decided("Put", SPEED, session=f"{session:x}"))
    log.take(cached("Put", SPEED, session="0"))
    assert log.counted().kinds == (
        RefusedKind(sender="", reason="say", key=SPEED, count=1),
        RefusedKind(sender="worker-w0", reason="say", key=SPEED, count=1010),
    )
    assert len(log._names) == 1000


def test_other_warnings_are_kept_for_the_log_in_bounds() -> None:
    log = RouterLog()
    log.take(record("well", target="zenoh::x", level="DEBUG"))
    log.take(b"thread panicked\n")
    for number in range(500):
        log.take(record(f"Unknown id {number}", target="zenoh::hat", level="ERROR"))
    kept = list(log.others())
    assert kept[0] == "thread panicked"
    assert kept[1].endswith("zenoh::hat: Unknown id 0")
    assert len(kept) == 100
    assert list(log.others()) == []


@given(st.lists(st.one_of(st.binary(), st.text().map(record))))
def test_nothing_that_is_said_ends_the_counting(records: list[bytes]) -> None:
    counted(*records)

"""A polite client of an Overpass endpoint: what it answers, whole and checked, or why not."""

from __future__ import annotations

import email.utils
import time
from collections.abc import Callable, Iterator, Mapping
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import MappingProxyType
from typing import IO

import httpx
import msgspec

from foretwin.contracts.errors import UserError
from foretwin.contracts.numbers import Range
from foretwin.contracts.toml_file import load_toml

BUSY = (429, 502, 503, 504)
"""Answers after which asking again later makes sense."""
CONNECT_TIMEOUT_S = 15.0
SPARE_S = 30.0
"""How much longer than its own limit the server is given."""
TAIL_BYTES = 4096

RANGES: Mapping[str, Range] = MappingProxyType(
    {
        "timeout_s": Range(1.0, 3600.0),
        "max_bytes": Range(1, 1 << 40),
        "retries": Range(0, 20),
        "back_off_s": Range(0.0, 600.0),
        "max_wait_s": Range(0.0, 3600.0),
        "margin_m": Range(0.0, 10_000.0),
    }
)
"""What its numbers may be."""


class OverpassError(UserError):
    """The endpoint gave no map; the message says what it gave instead."""


class OverpassConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Whom to ask for maps, and within which limits; nobody is asked by default."""

    endpoint: str
    """Such as https://overpass.example.org/api/interpreter."""
    user_agent: str
    """A contact, such as a mail address, which the endpoint's keepers can reach."""
    timeout_s: float = 180.0
    """How long the server may take for an answer."""
    max_bytes: int = 512 * 1024 * 1024
    """A larger answer is refused."""
    retries: int = 4
    """So often a busy server is asked again."""
    back_off_s: float = 5.0
    """Before the first repetition; doubled before each further one."""
    max_wait_s: float = 300.0
    """The longest wait between two attempts; an endpoint that asks for more is given up."""
    margin_m: float = 300.0
    """How far beside a route the map reaches."""

    def validate(self) -> OverpassConfig:
        """Return self, or raise OverpassError naming the first setting that cannot be used."""
        for good, rule in self._checks():
            if not good:
                raise OverpassError(f"overpass.{rule}")
        return self

    def _checks(self) -> Iterator[tuple[bool, str]]:
        """Yield what must hold, and what is said where it does not."""
        agent = self.user_agent
        yield self.endpoint.startswith(("http://", "https://")), "endpoint: an http(s) address"
        yield bool(agent.strip()), "user_agent: a contact, such as a mail address"
        yield agent.isprintable() and agent.isascii(), "user_agent: plain ASCII"
        for name, allowed in RANGES.items():
            yield allowed.admits(getattr(self, name)), f"{name}: {allowed}"


class OverpassFile(msgspec.Struct, frozen=True, kw_only=True):
    """A file of `foretwin map get --config`; other tables in it are not looked at."""

    overpass: OverpassConfig
    """Whom to ask for maps."""


class _BusyError(Exception):
    """This attempt failed in a way that may pass."""

    def __init__(self, reason: str, wait_s: float | None = None) -> None:
        super().__init__(reason)
        self.wait_s = wait_s


def load_overpass_config(path: Path | None) -> OverpassConfig:
    """Read the table `[overpass]` of a TOML file; the error says what to set."""
    wanted = 'a table [overpass] with endpoint = "https://…/api/interpreter" and user_agent = "…"'
    if path is None:
        raise OverpassError(f"no map server is known: name one by --config FILE, {wanted}")
    file = load_toml(path, "configuration", error=OverpassError)
    if "overpass" not in file.values:
        raise OverpassError(f"{path}: lacks {wanted}")
    config = file.convert(OverpassConfig, table="overpass")
    try:
        return config.validate()
    except OverpassError as wrong:
        raise file.wrong(wrong) from wrong


def fetch_map(
    config: OverpassConfig,
    query: str,
    target: IO[bytes],
    *,
    progress: Callable[[int, int | None], None] | None = None,
    said: Callable[[str], None] | None = None,
) -> None:
    """Write the answer to `target`, an empty file open for writing; ask again while it is busy.

    `progress` hears bytes and, where known, all bytes; `said` hears why it waits. Raises
    OverpassError where the endpoint refuses, stays busy, sends too much or no complete map.
    """
    agent = f"foretwin/{_own_version()} ({config.user_agent})"
    timeout = httpx.Timeout(config.timeout_s + SPARE_S, connect=CONNECT_TIMEOUT_S)
    with httpx.Client(
        headers={"User-Agent": agent, "Accept": "application/osm3s+xml, application/xml"},
        timeout=timeout,
        follow_redirects=True,
        max_redirects=3,
    ) as client:
        for attempt in range(config.retries + 1):
            target.seek(0)
            target.truncate()
            try:
                _attempt(client, config, query, target, progress)
            except _BusyError as error:
                if attempt == config.retries:
                    raise OverpassError(
                        f"{config.endpoint}: {error}; gave up after {attempt + 1} attempts"
                    ) from error
                wait_s = error.wait_s
                if wait_s is None:
                    wait_s = min(config.back_off_s * 2.0**attempt, config.max_wait_s)
                if wait_s > config.max_wait_s:
                    raise OverpassError(
                        f"{config.endpoint}: {error}; it asks to wait {wait_s:.0f} s "
                        f"(overpass.max_wait_s is {config.max_wait_s:.0f})"
                    ) from error
                if said is not None:
                    said(f"{error}; trying again in {wait_s:.0f} s")
                time.sleep(wait_s)
            except httpx.HTTPError as error:
                raise OverpassError(f"{config.endpoint}: {error}") from error
            else:
                return


def _attempt(
    client: httpx.Client,
    config: OverpassConfig,
    query: str,
    target: IO[bytes],
    progress: Callable[[int, int | None], None] | None,
) -> None:
    done = 0
    tail = b""
    try:
        with client.stream("POST", config.endpoint, data={"data": query}) as answer:
            if answer.status_code in BUSY:
                raise _BusyError(
                    f"answered {answer.status_code} {answer.reason_phrase}", _wait(answer)
                )
            if answer.status_code != 200:
                raise OverpassError(
                    f"{config.endpoint}: answered {answer.status_code} {answer.reason_phrase}"
                )
            encoded = "content-encoding" in answer.headers
            length = answer.headers.get("content-length", "")
            total = int(length) if length.isdigit() and not encoded else None
            _check_size(config, total or 0)
            for chunk in answer.iter_bytes():
                done += len(chunk)
                _check_size(config, done)
                target.write(chunk)
                tail = (tail + chunk)[-TAIL_BYTES:]
                if progress is not None:
                    progress(done, total)
    except (httpx.TransportError, httpx.DecodingError) as error:
        raise _BusyError(str(error) or type(error).__name__) from error
    target.flush()
    target.seek(0)
    _check_answer(config, target.read(TAIL_BYTES), tail)


def _check_size(config: OverpassConfig, size: int) -> None:
    if size > config.max_bytes:
        raise OverpassError(
            f"{config.endpoint}: the map is larger than {config.max_bytes} bytes "
            "(overpass.max_bytes); ask for less"
        )


def _check_answer(config: OverpassConfig, head: bytes, tail: bytes) -> None:
    """Refuse what is no OSM XML, or breaks off, or reports an error in the midst of it."""
    if b"<osm" not in head:
        start = " ".join(head[:80].decode(errors="replace").split())
        raise OverpassError(f"{config.endpoint}: the answer is no OSM XML: {start!r}")
    for part in (head, tail):
        _, found, rest = part.partition(b"<remark>")
        if found:
            remark = " ".join(rest.partition(b"</remark>")[0].decode(errors="replace").split())
            if "error" in remark.lower():
                raise OverpassError(f"{config.endpoint}: the map is not complete: {remark}")
    if not tail.rstrip().endswith(b"</osm>"):
        raise _BusyError("the answer breaks off before its end")


def _wait(answer: httpx.Response) -> float | None:
    """Return the seconds of a Retry-After header, given as a number or as a date."""
    text = answer.headers.get("retry-after", "").strip()
    if text.isdigit():
        return float(text)
    try:
        until = email.utils.parsedate_to_datetime(text)
    except (TypeError, ValueError):
        return None
    until = until if until.tzinfo else until.replace(tzinfo=UTC)
    return max(0.0, (until - datetime.now(UTC)).total_seconds())


def _own_version() -> str:
    try:
        return version("foretwin")
    except PackageNotFoundError:  # run from its source folder
        return "source"

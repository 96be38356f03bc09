"""What certificates say: for how long, for whom, by which authority; and what is wrong with them.

Zenoh tells a client that was refused nothing but a time-out, and the router only that somebody was.
What can be seen from here is looked at here.
"""

from __future__ import annotations

import datetime
import ipaddress
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from foretwin.contracts.campaign import TlsFiles
from foretwin.contracts.errors import UserError

UTC = datetime.UTC
HOW_TO_SET_CLOCK = "set the clock (timedatectl set-ntp true) and start again"


class Certificate(NamedTuple):
    """A certificate as far as it matters here; times are UTC."""

    name: str
    issuer: str
    first: datetime.datetime
    last: datetime.datetime
    hosts: tuple[str, ...]
    """Names and addresses that it stands for as a server."""


def read_certificate(file: Path) -> Certificate:
    """Read a PEM file; raises UserError where it is none."""
    from cryptography import x509

    read = _x509(file)
    try:
        names = read.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
        hosts = tuple(str(one.value) for one in names)
    except x509.ExtensionNotFound:
        hosts = ()
    return Certificate(
        name=_common_name(read.subject),
        issuer=_common_name(read.issuer),
        first=read.not_valid_before_utc,
        last=read.not_valid_after_utc,
        hosts=hosts,
    )


def troubles(files: TlsFiles, *, now: datetime.datetime) -> Iterator[str]:
    """Yield what is wrong with a role's files, each in one line; raises UserError for no PEM."""
    from cryptography.exceptions import InvalidSignature
    from cryptography.hazmat.primitives.serialization import load_pem_private_key

    for file in (files.authority, files.certificate):
        if line := time_trouble(read_certificate(Path(file)), file, now=now):
            yield line
    certificate, authority = _x509(Path(files.certificate)), _x509(Path(files.authority))
    try:
        certificate.verify_directly_issued_by(authority)
    except (InvalidSignature, ValueError, TypeError):
        yield f"{files.certificate}: made by another authority than {files.authority}"
    try:
        key = load_pem_private_key(Path(files.key).read_bytes(), None)
    except (ValueError, TypeError) as error:
        yield f"{files.key}: no private key: {error}"
        return
    if key.public_key() != certificate.public_key():
        yield f"{files.key}: not the key of {files.certificate}"


def time_trouble(certificate: Certificate, file: str, *, now: datetime.datetime) -> str | None:
    """Return what is wrong by the clock, None where nothing is.

    A clock before the certificate's first moment is the likelier fault: a machine without a battery
    wakes in 1970.
    """
    if now < certificate.first:
        return (
            f"{file}: this machine's clock says {now:%Y-%m-%d %H:%M} UTC, which is before the "
            f"certificate begins, {certificate.first:%Y-%m-%d %H:%M}; {HOW_TO_SET_CLOCK}"
        )
    if now > certificate.last:
        return (
            f"{file}: expired {certificate.last:%Y-%m-%d %H:%M} UTC; make another with "
            f"foretwin secure add {certificate.name} (or this machine's clock is ahead: it says "
            f"{now:%Y-%m-%d %H:%M})"
        )
    return None


def host_trouble(files: TlsFiles, host: str) -> str | None:
    """Return what is wrong where a router's certificate does not stand for `host`."""
    hosts = read_certificate(Path(files.certificate)).hosts
    if _plain(host) in map(_plain, hosts):
        return None
    known = ", ".join(hosts) or "no host"
    return (
        f"{files.certificate}: stands for {known}, not for {host}; make another with foretwin "
        f"secure add router --host {host}"
    )


def _plain(host: str) -> str:
    """Return one spelling of a host: TLS takes names in any case, and addresses by their value."""
    try:
        return str(ipaddress.ip_address(host.strip("[]")))
    except ValueError:
        return host.lower()


def _x509(file: Path) -> Any:
    from cryptography import x509

    try:
        return x509.load_pem_x509_certificate(file.read_bytes())
    except ValueError as error:
        raise UserError(f"{file}: no certificate: {error}") from error


def _common_name(name: Any) -> str:
    from cryptography.x509.oid import NameOID

    found = name.get_attributes_for_oid(NameOID.COMMON_NAME)
    return str(found[0].value) if found else ""

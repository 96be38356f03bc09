"""Makes the authority of one campaign and certificates of its roles, all of a short life.

A role that is lost cannot be called back (Zenoh 1.10 reads no revocation lists): the campaign ends,
and the next has an authority of its own.
"""

from __future__ import annotations

import datetime
import ipaddress
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from foretwin.contracts.campaign import (
    AUTHORITY,
    AUTHORITY_KEY,
    CERTIFICATE,
    KEY,
)
from foretwin.contracts.certificates import read_certificate, time_trouble
from foretwin.contracts.errors import UserError
from foretwin.contracts.partial_file import partial_file

LOCAL_HOSTS = "localhost", "127.0.0.1", "::1"
MOST_DAYS = 366
_DNS_NAME = re.compile(r"[A-Za-z0-9_]([A-Za-z0-9_-]{0,62})(\.[A-Za-z0-9_]([A-Za-z0-9_-]{0,62}))*")
_LONGEST_NAME = 253
_BEFORE = datetime.timedelta(minutes=10)
"""Clocks of two machines differ; a certificate begins so long before it was made."""


def make_authority(folder: Path, *, name: str, days: int, now: datetime.datetime) -> None:
    """Make the authority of a campaign in a folder that is its owner's alone.

    Raises UserError where there is one already: its certificates would be worth nothing.
    """
    from cryptography import x509

    check_days(days, "--campaign-days")
    if (folder / AUTHORITY).exists():
        raise UserError(f"{folder}: holds a campaign already; a new one needs a new folder")
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    folder.chmod(0o700)
    key = _new_key()
    builder = _begun(name, now=now).not_valid_after(now + datetime.timedelta(days=days))
    builder = builder.issuer_name(_named(name)).public_key(key.public_key())
    builder = builder.add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
    builder = builder.add_extension(_usage(signs_certificates=True), critical=True)
    builder = builder.add_extension(
        x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False
    )
    _write(folder / AUTHORITY_KEY, _key_pem(key))
    _write(folder / AUTHORITY, _signed_pem(builder, key))


def issue(
    folder: Path,
    role: str,
    *,
    days: int,
    now: datetime.datetime,
    hosts: Sequence[str] = (),
) -> Path:
    """Make or renew the certificate of a role; returns its folder.

    The router's stands for `hosts` as a server, and for those of the one before it, and for nothing
    else; every other one is a client's alone, so that no role can pose as the router. None outlives
    the authority. Raises UserError.
    """
    from cryptography import x509
    from cryptography.x509.oid import ExtendedKeyUsageOID

    check_days(days)
    authority, authority_key = _authority(folder, now=now)
    if hosts and role != "router":
        raise UserError(f"--host is of the router alone, not of {role}: others accept nobody")
    key = _new_key()
    last = min(now + datetime.timedelta(days=days), authority.not_valid_after_utc)
    builder = _begun(role, now=now).not_valid_after(last)
    builder = builder.issuer_name(authority.subject).public_key(key.public_key())
    builder = builder.add_extension(x509.BasicConstraints(ca=False, path_length=None), True)
    builder = builder.add_extension(_usage(signs_certificates=False), critical=True)
    serves = role == "router"
    purpose = ExtendedKeyUsageOID.SERVER_AUTH if serves else ExtendedKeyUsageOID.CLIENT_AUTH
    builder = builder.add_extension(x509.ExtendedKeyUsage([purpose]), critical=True)
    if serves:
        before = _hosts_before(folder / role / CERTIFICATE)
        names = [host_name(host) for host in dict.fromkeys((*LOCAL_HOSTS, *before, *hosts))]
        builder = builder.add_extension(x509.SubjectAlternativeName(names), critical=False)
    builder = builder.add_extension(
        x509.AuthorityKeyIdentifier.from_issuer_public_key(authority_key.public_key()), False
    )
    place = folder / role
    place.mkdir(mode=0o700, exist_ok=True)
    place.chmod(0o700)
    _write(place / KEY, _key_pem(key))
    _write(place / CERTIFICATE, _signed_pem(builder, authority_key))
    _write(place / AUTHORITY, (folder / AUTHORITY).read_bytes())
    return place


def _authority(folder: Path, *, now: datetime.datetime) -> tuple[Any, Any]:
    from cryptography import x509
    from cryptography.hazmat.primitives.serialization import load_pem_private_key

    file, key_file = folder / AUTHORITY, folder / AUTHORITY_KEY
    for needed in (file, key_file):
        if not needed.is_file():
            raise UserError(
                f"{needed}: missing; certificates are made where the campaign began "
                f"(foretwin secure init --folder {folder})"
            )
    certificate = read_certificate(file)
    if now > certificate.last:
        raise UserError(
            f"{file}: the campaign ended {certificate.last:%Y-%m-%d %H:%M} UTC; begin a new one in "
            "a new folder (foretwin secure init)"
        )
    if trouble := time_trouble(certificate, str(file), now=now):
        raise UserError(trouble)
    try:
        key = load_pem_private_key(key_file.read_bytes(), None)
    except (ValueError, TypeError) as error:
        raise UserError(f"{key_file}: no private key: {error}") from error
    return x509.load_pem_x509_certificate(file.read_bytes()), key


def check_days(days: int, option: str = "--days") -> None:
    """Raise UserError for a life that no certificate may have."""
    if not 1 <= days <= MOST_DAYS:
        raise UserError(f"{option} {days}: 1 to {MOST_DAYS}")


def _begun(name: str, *, now: datetime.datetime) -> Any:
    from cryptography import x509

    builder = x509.CertificateBuilder().subject_name(_named(name))
    builder = builder.serial_number(x509.random_serial_number())
    return builder.not_valid_before(now - _BEFORE)


def _named(name: str) -> Any:
    from cryptography import x509
    from cryptography.x509.oid import NameOID

    try:
        return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])
    except ValueError as error:
        raise UserError(f"--name {name!r}: {error}") from error


def _hosts_before(file: Path) -> tuple[str, ...]:
    """Return for whom the certificate stands that is renewed; of a broken one nobody."""
    try:
        return read_certificate(file).hosts
    except (OSError, UserError):
        return ()


def host_name(host: str) -> Any:
    """Return a host as a certificate names it; raises UserError for what names none."""
    from cryptography import x509

    try:
        return x509.IPAddress(ipaddress.ip_address(host.strip("[]")))
    except ValueError:
        pass
    if _DNS_NAME.fullmatch(host) is None or len(host) > _LONGEST_NAME:
        raise UserError(f"--host {host!r}: a host's name or address alone, such as twin-pc")
    return x509.DNSName(host)


def _new_key() -> Any:
    from cryptography.hazmat.primitives.asymmetric import ec

    return ec.generate_private_key(ec.SECP256R1())


def _usage(*, signs_certificates: bool) -> Any:
    from cryptography import x509

    return x509.KeyUsage(
        digital_signature=not signs_certificates,
        key_cert_sign=signs_certificates,
        crl_sign=signs_certificates,
        **dict.fromkeys(
            ("content_commitment", "key_encipherment", "data_encipherment", "key_agreement",
             "encipher_only", "decipher_only"),
            False,
        ),
    )  # fmt: skip


def _key_pem(key: Any) -> bytes:
    from cryptography.hazmat.primitives import serialization as form

    pem: bytes = key.private_bytes(form.Encoding.PEM, form.PrivateFormat.PKCS8, form.NoEncryption())
    return pem


def _signed_pem(builder: Any, key: Any) -> bytes:
    from cryptography.hazmat.primitives import hashes
    from cryptography.hazmat.primitives.serialization import Encoding

    pem: bytes = builder.sign(key, hashes.SHA256()).public_bytes(Encoding.PEM)
    return pem


def _write(file: Path, data: bytes) -> None:
    """Write a file that its owner alone may read, complete or not at all."""
    with partial_file(file) as partial:
        partial.unlink(missing_ok=True)
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
        with os.fdopen(os.open(partial, flags, 0o600), "wb") as opened:
            opened.write(data)

"""Why a client is not let onto a bus with certificates, as far as it can find out itself.

Zenoh tells it nothing but a time-out: here the files are looked at, then the way to the port, then
the first words of TLS, in which the router does say what it does not like.
"""

from __future__ import annotations

import contextlib
import datetime
import socket
import ssl
from collections.abc import Iterator

from foretwin.contracts.campaign import TlsFiles
from foretwin.contracts.certificates import HOW_TO_SET_CLOCK, UTC, troubles
from foretwin.contracts.errors import UserError
from foretwin.contracts.ports import ListenPlace, tls_place
from foretwin.contracts.process_setup import BusSetup

_REACH_S, _ALERT_S = 3.0, 0.5
ADMITTED = (
    "the router takes this certificate; what is refused beyond that is not of the role (the access "
    "rules go by it and say nothing to who is refused), or of another run"
)
_MEANINGS = {
    "CERTIFICATE_EXPIRED": "the router says that the certificate has expired: make another "
    f"(foretwin secure add ROLE), or the router's clock is wrong: {HOW_TO_SET_CLOCK}",
    "UNKNOWN_CA": "the router is of another campaign than this certificate",
    "DECRYPT_ERROR": "the router is of another campaign than this certificate",
    "BAD_CERTIFICATE": "the router does not take this certificate: of another campaign, or its "
    f"clock is wrong: {HOW_TO_SET_CLOCK}",
    "CERTIFICATE_REQUIRED": "the router wants a certificate and got none",
    "HOSTNAME_MISMATCH": "the router's certificate does not stand for this host: foretwin secure "
    "add router --host HOST, or reach it by a name that it stands for",
    "CERTIFICATE_VERIFY_FAILED": "the router is not of this campaign: its certificate is another "
    "authority's",
    "WRONG_VERSION_NUMBER": "what listens there speaks no TLS: a plain endpoint, or "
    "another program",
}


def likely_causes(setup: BusSetup, *, now: datetime.datetime | None = None) -> Iterator[str]:
    """Yield why who is so set up is refused, likeliest first, each in one line; none: it is not.

    Asks the router at most once, for some seconds at most.
    """
    place = tls_place(setup.endpoint)
    if setup.tls is None or place is None:
        return
    try:
        found = list(troubles(setup.tls, now=now or datetime.datetime.now(UTC)))
    except (UserError, OSError) as error:
        yield str(error)
        return
    yield from found
    if not found and (line := _answer(setup.tls, place)) is not None:
        yield line


def _answer(tls: TlsFiles, place: ListenPlace) -> str | None:
    """Return what the router has against a certificate, None where it takes it."""
    try:
        connection = socket.create_connection(place, timeout=_REACH_S)
    except UnicodeError:  # of a name that no network can have
        return f"{place.host}: no name of a host"
    except OSError as error:
        return f"nobody listens at {place.host}:{place.port}: {error.strerror or error}"
    with connection:
        context = ssl.create_default_context(cafile=tls.authority)
        context.minimum_version = ssl.TLSVersion.TLSv1_3
        context.load_cert_chain(tls.certificate, tls.key)
        try:
            with context.wrap_socket(connection, server_hostname=place.host) as secured:
                secured.settimeout(_ALERT_S)
                with contextlib.suppress(TimeoutError):  # it waits for us to go on
                    secured.recv(1)  # an alert about our certificate comes only now
        except TimeoutError:
            return _MEANINGS["WRONG_VERSION_NUMBER"]
        except ssl.SSLError as error:
            return _meaning(error)
        except OSError as error:
            return f"the router closes the connection: {error.strerror or error}"
    return None


def _meaning(error: ssl.SSLError) -> str:
    text = f"{error.reason} {getattr(error, 'verify_message', '')} {error}".upper()
    if "HOSTNAME MISMATCH" in text or "IP ADDRESS MISMATCH" in text:
        return _MEANINGS["HOSTNAME_MISMATCH"]
    if "EXPIRED" in text and "VERIFY_FAILED" in text:
        return f"the router's certificate has expired, or this clock is wrong: {HOW_TO_SET_CLOCK}"
    for word, meaning in _MEANINGS.items():
        if word in text:
            return meaning
    return f"TLS: {error.reason or error}"

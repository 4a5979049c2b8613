"""The folder that ``aloft keys`` makes: an authority, and for each party what it needs and no more.

``FOLDER/authority.pem`` and ``authority-key.pem`` stay where they are made. ``FOLDER/NAME/`` is for
the machine or observer of that name: its certificate and key, the authority's certificate, and
``session.json5``, the configuration of its Zenoh session. A run takes its own folder and refuses
one that was made for another graph.

Certificates are for sessions with mutual TLS, and their keys are those of NIST P-256. An authority
signs only what is made here.
"""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from ipaddress import ip_address
from pathlib import Path
from typing import Any

from ...files.names import inside
from ...files.pip_line import pip_line
from ...runtime.language.errors import AloftError
from ...runtime.placement.placed import PlacedGraph
from ...runtime.transports.tls import (
    AUTHORITY,
    CERTIFICATE,
    KEY,
    SESSION,
    check_endpoints,
    party_access,
    tls_settings,
)
from ...runtime.transports.zenoh_session import Limits, session_settings

AUTHORITY_KEY = "authority-key.pem"
_EARLIER = timedelta(minutes=10)
"""Clocks of other machines may be late."""


@dataclass(frozen=True)
class Authority:
    """Certificate authority: its certificate and its key."""

    certificate: Any
    key: Any

    @classmethod
    def make(cls, name: str, days: int) -> Authority:
        """Make a new certificate authority, valid for this many days."""
        x509, hashes, ec = _library()
        key = ec.generate_private_key(ec.SECP256R1())
        subject = _name(name)
        certificate = (
            _builder(subject, subject, key.public_key(), days)
            .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
            .add_extension(_usage(sign=True), critical=True)
            .sign(key, hashes.SHA256())
        )
        return cls(certificate, key)

    @classmethod
    def read(cls, folder: Path) -> Authority:
        """Read the authority that a folder holds.

        Raises:
            AloftError: its files cannot be read.
        """
        x509, _, _ = _library()
        from cryptography.hazmat.primitives.serialization import load_pem_private_key

        try:
            certificate = x509.load_pem_x509_certificate((folder / AUTHORITY).read_bytes())
            key = load_pem_private_key((folder / AUTHORITY_KEY).read_bytes(), None)
        except (OSError, ValueError) as error:
            raise AloftError(
                f"the authority in {folder} cannot be read: {error}; --anew makes another, with "
                "which all certificates have to be made again"
            ) from error
        return cls(certificate, key)

    def write(self, folder: Path) -> None:
        """Keep both files; only the owner can read the key."""
        _own_folder(folder)
        (folder / AUTHORITY).write_bytes(_pem(self.certificate))
        _write_secret(folder / AUTHORITY_KEY, self.key)

    def sign(self, name: str, hosts: Sequence[str], days: int, folder: Path) -> None:
        """Write the certificate and key of one party, and this authority's certificate, to a folder.

        Args:
            name: the common name, by which the others know the party.
            hosts: the addresses and names at which it listens.
            days: for how many days it is valid.
            folder: where the files go.
        """
        x509, hashes, ec = _library()
        from cryptography.x509.oid import ExtendedKeyUsageOID as Usage

        key = ec.generate_private_key(ec.SECP256R1())
        builder = (
            _builder(_name(name), self.certificate.subject, key.public_key(), days)
            .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
            .add_extension(_usage(sign=False), critical=True)
            .add_extension(
                x509.ExtendedKeyUsage([Usage.SERVER_AUTH, Usage.CLIENT_AUTH]), critical=False
            )
            .add_extension(
                x509.SubjectAlternativeName([_host(host) for host in hosts]), critical=False
            )
        )
        _own_folder(folder)
        (folder / CERTIFICATE).write_bytes(_pem(builder.sign(self.key, hashes.SHA256())))
        _write_secret(folder / KEY, key)
        (folder / AUTHORITY).write_bytes(_pem(self.certificate))

    def signed(self, folder: Path) -> bool:
        """Return whether a folder holds a certificate of this authority that is valid for another
        day."""
        x509, _, _ = _library()
        try:
            certificate = x509.load_pem_x509_certificate((folder / CERTIFICATE).read_bytes())
            certificate.verify_directly_issued_by(self.certificate)
        except Exception:  # noqa: BLE001  # whatever is wrong with it, a new one is made
            return False
        later = datetime.now(UTC) + timedelta(days=1)
        return (folder / KEY).is_file() and certificate.not_valid_after_utc > later


def hosts_of(folder: Path) -> list[str]:
    """Return the addresses and names that the certificate in a folder is for."""
    x509, _, _ = _library()
    certificate = x509.load_pem_x509_certificate((folder / CERTIFICATE).read_bytes())
    found = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    return [str(name.value) for name in found]


def _library() -> tuple[Any, Any, Any]:
    try:
        from cryptography import x509
        from cryptography.hazmat.primitives import hashes
        from cryptography.hazmat.primitives.asymmetric import ec
    except ImportError as error:
        raise AloftError(
            f"certificates are made with the library cryptography: {pip_line('keys')}"
        ) from error
    return x509, hashes, ec


def _name(text: str) -> Any:
    x509, _, _ = _library()
    return x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, text)])


def _host(host: str) -> Any:
    x509, _, _ = _library()
    try:
        return x509.IPAddress(ip_address(host))
    except ValueError:
        return x509.DNSName(host)


def _builder(subject: Any, issuer: Any, public_key: Any, days: int) -> Any:
    x509, _, _ = _library()
    now = datetime.now(UTC)
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(public_key)
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - _EARLIER)
        .not_valid_after(now + timedelta(days=days))
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(public_key), critical=False)
    )


def _usage(*, sign: bool) -> Any:
    """Return the usage of a key: signing certificates, or else signing the messages of a
    session."""
    x509, _, _ = _library()
    return x509.KeyUsage(
        digital_signature=not sign, key_cert_sign=sign, crl_sign=sign, content_commitment=False,
        key_encipherment=False, data_encipherment=False, key_agreement=False, encipher_only=False,
        decipher_only=False,
    )  # fmt: skip


def _pem(certificate: Any) -> bytes:
    from cryptography.hazmat.primitives.serialization import Encoding

    data: bytes = certificate.public_bytes(Encoding.PEM)
    return data


def _own_folder(folder: Path) -> None:
    """Make a folder that only its owner can enter, also where it was there before."""
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    folder.chmod(0o700)


def _write_secret(path: Path, key: Any) -> None:
    """Write a private key that only the owner can read, from the first byte on."""
    from cryptography.hazmat.primitives import serialization as s

    data = key.private_bytes(s.Encoding.PEM, s.PrivateFormat.PKCS8, s.NoEncryption())
    path.unlink(missing_ok=True)
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
        file.write(data)


_LOOPBACK = ("127.0.0.1", "localhost")


def host_of(endpoint: str) -> str:
    """Return the address or name in ``tls/ADDRESS:PORT``."""
    return endpoint.partition("/")[2].rpartition(":")[0].strip("[]")


def make_keys(
    placed: PlacedGraph, folder: Path, observers: Sequence[str] = (), *,
    days: int = 365, anew: bool = False,
) -> list[str]:  # fmt: skip
    """Write authority, certificates and sessions; what is there and still good is kept.

    Args:
        placed: the graph.
        folder: where.
        observers: names of those that may watch.
        days: for how many days certificates are valid.
        anew: whether to make another authority, so that all earlier certificates are worthless.

    Returns:
        The names of those whose certificate was made.

    Raises:
        AloftError: a name is used twice, an endpoint is not ``tls``, or the authority cannot be read.
    """
    machines = [spec.name for spec in placed.machines]
    for name in observers:
        if name in machines or observers.count(name) > 1:
            raise AloftError(f"{name!r} cannot be an observer: the name is used already")
        if not name.replace("-", "").replace("_", "").isalnum():
            raise AloftError(
                f"{name!r} cannot name an observer: expected letters, digits, '-', '_'"
            )
    check_endpoints(placed)
    if anew or not (folder / AUTHORITY).is_file():
        authority = Authority.make(f"aloft {placed.graph.name}", days)
        authority.write(folder)
    else:
        authority = Authority.read(folder)
    made = []
    for name in (*machines, *observers):
        own = inside(folder, name)
        hosts = list(_LOOPBACK)
        if name in machines:
            host = host_of(placed.machine(name).endpoint)
            hosts = list(dict.fromkeys([host, *hosts]))
        if not authority.signed(own) or not _is_for(own, hosts):
            authority.sign(name, hosts, days, own)
            made.append(name)
        (own / SESSION).write_text(json.dumps(_session(placed, name, observers), indent=2) + "\n")
    return made


def _session(placed: PlacedGraph, name: str, observers: Sequence[str]) -> dict[str, Any]:
    """Return the configuration of a session, as Zenoh reads it, with paths relative to its own
    folder."""
    names = [spec.name for spec in placed.machines]
    ends = [spec.endpoint for spec in placed.machines]
    place = names.index(name) if name in names else len(names)
    nested: dict[str, Any] = {}
    settings = session_settings(ends[place : place + 1], ends[:place], Limits.of(placed))
    settings |= {
        "transport/link/tls": tls_settings(Path()),
        "access_control": party_access(placed, name, observers),
    }
    for key, value in settings.items():
        *outer, last = key.split("/")
        at = nested
        for part in outer:
            at = at.setdefault(part, {})
        at[last] = value
    return {**nested, "metadata": {"observers": list(observers)}}


def _is_for(folder: Path, hosts: Sequence[str]) -> bool:

    return sorted(hosts_of(folder)) == sorted(hosts)

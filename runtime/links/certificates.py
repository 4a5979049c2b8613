"""Makes an authority, and certificates that it signs, for sessions with mutual TLS.

Keys are those of NIST P-256. An authority signs nothing but what it is asked to here, and its own key
stays where the keys are made.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from ipaddress import ip_address
from pathlib import Path
from typing import Any

from ..language.errors import AloftError

CERTIFICATE, KEY, AUTHORITY = "certificate.pem", "key.pem", "authority.pem"
"""The files of one party: what it is known by, its secret, and whom it trusts."""
AUTHORITY_KEY = "authority-key.pem"
_EARLIER = timedelta(minutes=10)
"""Clocks of other machines may be late."""


@dataclass(frozen=True)
class Authority:
    """Who signs: its certificate and its key."""

    certificate: Any
    key: Any

    @classmethod
    def make(cls, name: str, days: int) -> Authority:
        """A new one, which is valid for so many days."""
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
        """The one that a folder holds.

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
        folder.mkdir(parents=True, exist_ok=True)
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
        folder.mkdir(parents=True, exist_ok=True)
        (folder / CERTIFICATE).write_bytes(_pem(builder.sign(self.key, hashes.SHA256())))
        _write_secret(folder / KEY, key)
        (folder / AUTHORITY).write_bytes(_pem(self.certificate))

    def signed(self, folder: Path) -> bool:
        """Whether a folder holds a certificate of this authority that is valid for another day."""
        x509, _, _ = _library()
        try:
            certificate = x509.load_pem_x509_certificate((folder / CERTIFICATE).read_bytes())
            certificate.verify_directly_issued_by(self.certificate)
        except Exception:  # noqa: BLE001  # whatever is wrong with it, a new one is made
            return False
        later = datetime.now(UTC) + timedelta(days=1)
        return (folder / KEY).is_file() and certificate.not_valid_after_utc > later


def hosts_of(folder: Path) -> list[str]:
    """The addresses and names that the certificate in a folder is for."""
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
            "certificates are made with the library cryptography: pip install 'aloft[keys]'"
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
    """Signing certificates, or else signing what a session says."""
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


def _write_secret(path: Path, key: Any) -> None:
    """Write a private key that only the owner can read, from the first byte on."""
    from cryptography.hazmat.primitives import serialization as s

    data = key.private_bytes(s.Encoding.PEM, s.PrivateFormat.PKCS8, s.NoEncryption())
    path.unlink(missing_ok=True)
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
        file.write(data)

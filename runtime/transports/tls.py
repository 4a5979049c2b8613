"""Settings of a session of links over TLS from its folder of keys: certificates and access control.

The extension ``deployment`` makes such folders; see ``aloft keys``.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..language.errors import AloftError
from ..placement.placed import PlacedGraph
from .zenoh_session import access_control, observers_access

CERTIFICATE, KEY, AUTHORITY = "certificate.pem", "key.pem", "authority.pem"
"""The files of one party: its certificate, its private key, and the authority's certificate."""
SESSION = "session.json5"
"""The configuration of a party's Zenoh session."""


def check_endpoints(placed: PlacedGraph) -> None:
    """Refuse endpoints without encryption.

    Raises:
        AloftError: one is not ``tls``; the error has the fix.
    """
    for spec in placed.machines:
        if not spec.endpoint.startswith("tls/"):
            secure = f"tls/{spec.endpoint.partition('/')[2]}"
            raise AloftError(
                f"machine {spec.name!r} listens at {spec.endpoint}, where anybody who reaches it can "
                f"command; write machines: {{{spec.name}: {secure}}}, or --set "
                f"machines.{spec.name}={secure}"
            )


def secured(placed: PlacedGraph, folder: Path, name: str) -> dict[str, Any]:
    """Read the settings of a session of ``name`` from its folder: TLS and access control.

    Raises:
        AloftError: the folder lacks a file, or was made for another graph.
    """
    own = folder / name if (folder / name).is_dir() else folder
    for file in (CERTIFICATE, KEY, AUTHORITY, SESSION):
        if not (own / file).is_file():
            raise AloftError(f"{own / file} is missing: `aloft keys GRAPH -o {folder}` makes it")
    try:
        session = json.loads((own / SESSION).read_text("utf-8"))
        access, observers = session["access_control"], session["metadata"]["observers"]
    except (ValueError, KeyError, TypeError) as error:
        raise AloftError(f"{own / SESSION} cannot be read: {error}") from error
    machines = [spec.name for spec in placed.machines]
    expected = party_access(placed, name, observers)
    if access != expected:
        raise AloftError(
            f"{own / SESSION} was made for another graph than {placed.graph.name}, with other "
            f"machines ({', '.join(machines)}) or links: `aloft keys` with this graph makes it anew "
            "and keeps the certificates"
        )
    return {"transport/link/tls": tls_settings(own), "access_control": access}


def party_access(placed: PlacedGraph, name: str, observers: Sequence[str]) -> dict[str, Any]:
    """Return the access control of a machine or an observer, as Zenoh reads it."""
    if name in [spec.name for spec in placed.machines]:
        return access_control(placed, name, observers)
    return observers_access(placed, name)


def tls_settings(folder: Path) -> dict[str, Any]:
    """Return the TLS settings of a Zenoh session whose files are in ``folder``."""
    certificate, key = str(folder / CERTIFICATE), str(folder / KEY)
    return {
        "root_ca_certificate": str(folder / AUTHORITY),
        "listen_certificate": certificate,
        "listen_private_key": key,
        "connect_certificate": certificate,
        "connect_private_key": key,
        "enable_mtls": True,
        "verify_name_on_connect": True,
    }

"""The folder that ``aloft keys`` makes: an authority, and for each party what it needs and no more.

``FOLDER/authority.pem`` and ``authority-key.pem`` stay where they are made. ``FOLDER/NAME/`` is for the
machine or observer of that name: its certificate and key, the authority's certificate, and
``session.json5``, the configuration of its Zenoh session. A run takes its own folder and refuses one that
was made for another graph.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..language.errors import AloftError
from ..placement.placed import PlacedGraph
from .access import access_control, observers_access
from .certificates import AUTHORITY, CERTIFICATE, KEY, Authority
from .zenoh_transport import session_settings

SESSION = "session.json5"
_LOOPBACK = ("127.0.0.1", "localhost")


def host_of(endpoint: str) -> str:
    """The address or name in ``tls/ADDRESS:PORT``."""
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
        own = folder / name
        hosts = list(_LOOPBACK)
        if name in machines:
            host = host_of(placed.machine(name).endpoint)
            hosts = list(dict.fromkeys([host, *hosts]))
        if not authority.signed(own) or not _is_for(own, hosts):
            authority.sign(name, hosts, days, own)
            made.append(name)
        (own / SESSION).write_text(json.dumps(_session(placed, name, observers), indent=2) + "\n")
    return made


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
    """What a session of ``name`` takes over from its folder: TLS and access control.

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
    expected = _access(placed, name, observers)
    if access != expected:
        raise AloftError(
            f"{own / SESSION} was made for another graph than {placed.graph.name}, with other "
            f"machines ({', '.join(machines)}) or links: `aloft keys` with this graph makes it anew "
            "and keeps the certificates"
        )
    return {"transport/link/tls": _tls(own), "access_control": access}


def _access(placed: PlacedGraph, name: str, observers: Sequence[str]) -> dict[str, Any]:
    if name in [spec.name for spec in placed.machines]:
        return access_control(placed, name, observers)
    return observers_access(placed, name)


def _session(placed: PlacedGraph, name: str, observers: Sequence[str]) -> dict[str, Any]:
    """The configuration of a session, as Zenoh reads it, with paths relative to its own folder."""
    names = [spec.name for spec in placed.machines]
    ends = [spec.endpoint for spec in placed.machines]
    place = names.index(name) if name in names else len(names)
    nested: dict[str, Any] = {}
    settings = session_settings(ends[place : place + 1], ends[:place])
    settings |= {
        "transport/link/tls": _tls(Path()),
        "access_control": _access(placed, name, observers),
    }
    for key, value in settings.items():
        *outer, last = key.split("/")
        at = nested
        for part in outer:
            at = at.setdefault(part, {})
        at[last] = value
    return {**nested, "metadata": {"observers": list(observers)}}


def _tls(folder: Path) -> dict[str, Any]:
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


def _is_for(folder: Path, hosts: Sequence[str]) -> bool:
    from .certificates import hosts_of

    return sorted(hosts_of(folder)) == sorted(hosts)

"""The user's cache folder, which keeps between runs machine code, checked plans and tables.

Everything that is kept goes through ``Cache``. A file ends with a digest over its name and its content, so
one that is damaged, cut off or exchanged for another is not used, and what it held is made anew. A file
appears whole or not at all: it is written under another name, flushed to the disk and renamed. It is
used only if it and its folders belong to this user and nobody else may write there, because machine code
that another user laid there would run with this user's rights. Where the folder is missing, belongs to
somebody else or cannot be written, nothing is kept, and everything works.
"""

from __future__ import annotations

import hashlib
import os
import stat
import tempfile
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

DIGEST = 16
"""Bytes of the digest at a file's end."""
_NO_LINK = getattr(os, "O_NOFOLLOW", 0)
_OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH


def cache_root() -> Path | None:
    """Return the folder ``aloft`` in the user's cache folder; ``None`` where the user has no home."""
    given = os.environ.get("XDG_CACHE_HOME", "")
    try:
        # by the XDG specification a relative path does not count
        root = Path(given) if os.path.isabs(given) else Path.home() / ".cache"
    except RuntimeError:
        return None
    return root / "aloft"


@dataclass(frozen=True)
class Cache:
    """One kind of results that are kept.

    Attributes:
        kind: the name of its folder below ``cache_root()``.
        suffix: what the files' names end with.
        most: the number of files that are kept, those used last; zero: any number.
    """

    kind: str
    suffix: str = ""
    most: int = 0

    @property
    def folder(self) -> Path | None:
        """The folder, whether it is there or not; ``None`` where the user has no home."""
        root = cache_root()
        return None if root is None else root / self.kind

    def path(self, name: str) -> Path | None:
        """Return the place of what is called ``name``; names may have folders in them."""
        folder = self.folder
        return None if folder is None else folder / f"{name}{self.suffix}"

    def load(self, name: str) -> bytes | None:
        """Return what is kept under ``name``; ``None`` where that is nothing, or must not be used."""
        root = cache_root()
        # texts and no paths: a graph loads two hundred kernels
        path = f"{root}/{self.kind}/{name}{self.suffix}"
        if root is None or not _trusted_folders(path, str(root)):
            return None
        try:
            descriptor = os.open(path, os.O_RDONLY | _NO_LINK)
            try:
                found = os.fstat(descriptor)
                content = os.read(descriptor, found.st_size + 1) if _trusted(found) else b""
            finally:
                os.close(descriptor)
            if self.most:
                os.utime(path)
        except OSError:
            return None
        return unsealed(f"{self.kind}/{name}", content)

    def holds(self, name: str) -> bool:
        """Return whether there is a file for ``name``, without reading it."""
        path = self.path(name)
        return path is not None and path.is_file()

    def save(self, name: str, data: bytes) -> bool:
        """Keep ``data`` under ``name``. Returns whether that was possible."""
        path = self.path(name)
        if path is None:
            return False
        try:
            if not make_folders(path.parent):
                return False
            handle, temporary = tempfile.mkstemp(dir=path.parent, suffix=".part")  # mode 0600
            try:
                with os.fdopen(handle, "wb") as file:
                    file.write(sealed(f"{self.kind}/{name}", data))
                    file.flush()
                    os.fsync(file.fileno())
                os.replace(temporary, path)
            except BaseException:
                Path(temporary).unlink(missing_ok=True)
                raise
            if self.most:
                kept = sorted(path.parent.iterdir(), key=lambda each: each.stat().st_mtime)
                for old in kept[: -self.most]:
                    old.unlink(missing_ok=True)
        except OSError:
            return False
        return True


def sealed(name: str, data: bytes) -> bytes:
    """Return data with the digest of name and content at the end."""
    return data + _digest(name, data)


def unsealed(name: str, content: bytes) -> bytes | None:
    """Return the data before the digest, or ``None`` where that does not fit."""
    data, digest = content[:-DIGEST], content[-DIGEST:]
    return data if digest == _digest(name, data) else None


def _digest(name: str, data: bytes) -> bytes:
    return hashlib.blake2b(
        data, digest_size=DIGEST, key=hashlib.sha256(name.encode()).digest()
    ).digest()


def _trusted_folders(path: str, root: str) -> bool:
    """Return whether all folders of a file, from ``root`` down, are this user's only."""
    if not path.startswith(f"{root}/"):
        return False
    end = len(root)
    try:
        while end >= 0:
            if not _trusted(os.stat(path[:end])):
                return False
            end = path.find("/", end + 1)
    except OSError:
        return False
    return True


def trusted_file(path: Path) -> bool:
    """Return whether a file in the cache folder, and the folders it is in, are this user's only."""
    root = cache_root()
    with suppress(OSError):
        found = path.stat(follow_symlinks=False)
        return root is not None and _trusted(found) and _trusted_folders(str(path), str(root))
    return False


def make_folders(folder: Path) -> bool:
    """Make a folder below ``cache_root()`` for this user only.

    Folders of this user's in which others may write, as earlier versions made them under some masks, are
    closed to them; what others may have laid there is theirs, so it is not used. Returns whether the
    folders can be used.

    Raises:
        OSError: they cannot be made.
    """
    root = cache_root()
    if root is None:
        return False
    root.parent.mkdir(parents=True, exist_ok=True)
    inner = folder.relative_to(root).parts
    for each in (root, *(root.joinpath(*inner[: k + 1]) for k in range(len(inner)))):
        with suppress(FileExistsError):
            each.mkdir(mode=0o700)
        found = each.stat()
        if found.st_mode & _OTHERS_WRITE and found.st_uid == _user():
            each.chmod(stat.S_IMODE(found.st_mode) & ~_OTHERS_WRITE)
            found = each.stat()
        if not _trusted(found):
            return False
    return True


def _trusted(found: os.stat_result) -> bool:
    """Return whether a file or folder is this user's, and nobody else may write there."""
    return found.st_uid == _user() and not found.st_mode & _OTHERS_WRITE


def _user() -> int:
    return os.geteuid()

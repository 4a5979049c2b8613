"""The file of a recording: written under a name of its own that is locked, then renamed.

While ``jump.rrd`` is written it is called ``jump.part.rrd``, and whoever writes it holds an
exclusive lock on it. Anybody may read it meanwhile. What was called ``jump.rrd`` before stays there
until the new recording is complete. A symbolic link stays: the file that it names is replaced. What
is no file, such as a device or a FIFO, is refused.
"""

from __future__ import annotations

import errno
import os
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

try:
    import fcntl
except ImportError:  # on Windows; there another writer is not noticed
    fcntl = None  # type: ignore[assignment]  # not on Windows

UNFINISHED = ".part"
_MOST_NAMES = 100


def unfinished_name(path: Path) -> Path:
    """Return the name under which the recording ``path`` is written."""
    return path.with_name(f"{path.stem}{UNFINISHED}{path.suffix}")


def finished_name(path: Path) -> Path | None:
    """Return the recording that is written under the name ``path``; ``None`` if it is no such name."""
    if not path.stem.endswith(UNFINISHED):
        return None
    return path.with_name(f"{path.stem.removesuffix(UNFINISHED)}{path.suffix}")


def is_being_written(path: Path) -> bool:
    """Tell whether a recorder is writing the file ``path``. Raises ``OSError`` if it is not there."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        return not _lock(descriptor)
    finally:
        os.close(descriptor)


def _lock(descriptor: int) -> bool:
    if fcntl is None:
        return True
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError as error:
        if error.errno in (errno.ENOLCK, errno.EOPNOTSUPP, errno.EINVAL):
            return True  # a file system without locks
        raise
    return True


@dataclass
class OutputFile:
    """The file of a recording, locked by this process and by those that inherit ``descriptor``.

    Attributes:
        target: the name that the recording will have.
        descriptor: the open file under its private name.
        keep: how many earlier recordings of that name are kept, as ``jump.1.rrd`` (the newest) ...
        said: what the user must know, one text each.
    """

    target: Path
    descriptor: int
    keep: int
    said: tuple[str, ...] = ()

    @property
    def unfinished(self) -> Path:
        """The private name."""
        return unfinished_name(self.target)

    def close(self) -> None:
        """Close the file; the lock goes when the last process has closed it."""
        with suppress(OSError):
            os.close(self.descriptor)

    def discard(self) -> None:
        """Remove the file, into which nothing has come; what had its name before stays."""
        with suppress(OSError):
            if self._is_there():
                self.unfinished.unlink()

    def publish(self) -> str:
        """Give the file its name. Returns a warning if it had been removed, else nothing.

        Raises:
            OSError: it cannot be renamed, or a removed file cannot be written again.
        """
        warning = ""
        if not self._is_there():
            self._write_again()
            warning = (
                f"somebody removed {self.unfinished} while the run went on; it was written again when "
                "the run ended"
            )
        for number in range(self.keep, 0, -1):
            older = self.target if number == 1 else _numbered(self.target, number - 1)
            if older.exists():
                os.replace(older, _numbered(self.target, number))
        os.replace(self.unfinished, self.target)
        return warning

    def _is_there(self) -> bool:
        try:
            return os.path.samestat(os.fstat(self.descriptor), os.stat(self.unfinished))
        except FileNotFoundError:
            return False

    def _write_again(self) -> None:
        """Copy the file, which has no name any more, to its private name."""
        self.unfinished.parent.mkdir(parents=True, exist_ok=True)
        with self.unfinished.open("wb") as file:
            offset = 0
            while piece := os.pread(self.descriptor, 1 << 20, offset):
                file.write(piece)
                offset += len(piece)


def split_name(path: Path, number: int) -> Path:
    """Return the name of a later file of a recording in several: ``jump-part002.rrd`` follows
    ``jump.rrd``."""
    return path.with_name(f"{path.stem}-part{number:03d}{path.suffix}")


def _numbered(path: Path, number: int) -> Path:
    return path.with_name(f"{path.stem}.{number}{path.suffix}")


def reserve_output(path: Path, keep: int = 0) -> OutputFile:
    """Make and lock the file in which the recording ``path`` is written.

    If another run writes that recording, this one gets the next free name, ``jump-2.rrd``. A file
    that a killed recorder has left there is kept under another name.

    Raises:
        OSError: the file cannot be written.
    """
    if path.is_symlink():
        path = Path(os.path.realpath(path))
    if path.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if path.exists() and not path.is_file():
        raise OSError(errno.EINVAL, f"it is no file but {_kind_of(path)}", str(path))
    path.parent.mkdir(parents=True, exist_ok=True)
    for number in range(1, _MOST_NAMES):
        target = path if number == 1 else path.with_name(f"{path.stem}-{number}{path.suffix}")
        output = _take(target, keep)
        if output is not None:
            if number > 1:
                text = f"another run is being recorded in {path}; this one goes to {target}"
                output.said = (text, *output.said)
            return output
    raise OSError(errno.EBUSY, f"{_MOST_NAMES} runs are being recorded under this name", str(path))


def _kind_of(path: Path) -> str:
    """Describe ``path``, which is no file, in words."""
    if path.is_fifo():
        return "a FIFO"
    return "a socket" if path.is_socket() else "a device"


def _take(target: Path, keep: int) -> OutputFile | None:
    """Take the place of ``target``; return ``None`` if another run has it."""
    unfinished, said = unfinished_name(target), ""
    while True:
        descriptor = os.open(unfinished, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
        try:
            if not _lock(descriptor):
                os.close(descriptor)
                return None
            there = unfinished.exists() and os.path.samestat(
                os.fstat(descriptor), os.stat(unfinished)
            )
            if there and not os.fstat(descriptor).st_size:
                return OutputFile(target, descriptor, keep, (said,) if said else ())
            if there:
                moved = _free(target)
                os.replace(unfinished, moved)
                said = (
                    f"{unfinished} was left by a run whose recorder was killed; it is kept as {moved} "
                    f"('aloft log repair {moved}' mends it)"
                )
        except BaseException:
            os.close(descriptor)
            raise
        os.close(descriptor)


def _free(target: Path) -> Path:
    """Find a free name beside ``target``."""
    number = 1
    while True:
        suffix = "" if number == 1 else f"-{number}"
        found = target.with_name(f"{target.stem}-cut{suffix}{target.suffix}")
        if not found.exists():
            return found
        number += 1


def replaced(path: Path, keep: int = 0) -> str:
    """Describe the fate of the recording that has the name ``path`` now, in words; empty without
    one."""
    try:
        made = datetime.fromtimestamp(path.stat().st_mtime)
    except OSError:
        return ""
    when = f"{made:%Y-%m-%d %H:%M:%S}"
    if keep:
        return f"the one of {when} is kept as {_numbered(path, 1)}"
    return f"it replaces the one of {when}; --keep N keeps as many"


ELSEWHERE = "--record FILE writes elsewhere, --no-record writes none"


def remedy(number: int, path: Path | None, elsewhere: str = ELSEWHERE) -> str:
    """Describe the fix for an error with the system's ``number`` (as in ``errno``) at ``path``, in
    words; ``elsewhere`` says how to do without that place."""
    if number in (errno.ENOSPC, errno.EDQUOT):
        return f"make room{_room(path)}, or {elsewhere}"
    if number == errno.EFBIG:
        return f"allow larger files{_limit()} (`ulimit -f`), or {elsewhere}"
    if number in (errno.EACCES, errno.EPERM, errno.EROFS):
        return f"allow writing there, or {elsewhere}"
    return elsewhere


def cause_of(error: BaseException) -> int:
    """Return the system's number of the underlying error, also where a clearer error stands for it;
    or zero."""
    return getattr(error.__cause__ or error, "errno", None) or 0


def _room(path: Path | None) -> str:
    """Describe the free space on the disk of ``path``."""
    if path is None:
        return ""
    folder = path.absolute().parent
    try:
        found = os.statvfs(folder)
    except (OSError, AttributeError):  # the second on Windows
        return ""
    return f" on the disk of {folder} ({found.f_bavail * found.f_frsize / 1e6:.1f} MB are free)"


def _limit() -> str:
    try:
        import resource
    except ImportError:  # not on Windows
        return ""
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)[0]
    return "" if limit == resource.RLIM_INFINITY else f" than {limit / 1e6:.3g} MB"

"""`python3 -m resonarm export`: recordings in the formats that Python's libraries write best."""

import argparse
import errno
import sys
import warnings
from pathlib import Path

from . import export
from ._resonarm import ResonarmError, __version__
from .recording import Recording

LACKING = {
    errno.ENOSPC,
    errno.EDQUOT,
    errno.EFBIG,
    errno.EIO,
    errno.EACCES,
    errno.EPERM,
    errno.EROFS,
    errno.EMFILE,
    errno.ENFILE,
    errno.ENOMEM,
}
"""Refusals for want of space, privilege, memory or file descriptors. The refusal to read a recording has no number."""


def main(words: list[str] | None = None) -> int:
    """Runs a command. Returns the exit code: 0 done, 1 the recording is not whole, 2 wrong input, 3 something is
    missing in this environment."""
    parser = argparse.ArgumentParser(prog="python3 -m resonarm", description=__doc__)
    parser.add_argument("--version", action="version", version=f"resonarm {__version__}")
    commands = parser.add_subparsers(dest="command", required=True)
    exporting = commands.add_parser("export", help="a recording as Parquet, MF4 or BLF")
    exporting.add_argument("recording", type=Path, help="the recording, an MCAP file")
    exporting.add_argument("--to", required=True, choices=export.FORMATS, help="the format")
    exporting.add_argument("--out", type=Path, metavar="STEM", help="stem of the files, else the recording's")
    exporting.add_argument("--overwrite", action="store_true", help="write over files that are there")
    given = parser.parse_args(words)
    try:
        stem = given.out or given.recording.with_suffix("")
        with warnings.catch_warnings():
            warnings.showwarning = _warn  # type: ignore[assignment]
            recording = Recording(given.recording)
            written = export.of_recording(recording, given.to, stem, given.overwrite)
        for path in written:
            print(path)
    except ModuleNotFoundError as error:
        return _refuse(error, 3)
    except OSError as error:
        return _refuse(error, 3 if error.errno in LACKING else 2)
    except MemoryError:
        return _refuse(MemoryError("there is not enough memory"), 3)
    except (ValueError, ResonarmError) as error:
        return _refuse(error, 2)
    # What was readable is written, and the warning says what is missing.
    return 0 if recording.damage is None else 1


def _warn(message: Warning | str, *_: object) -> None:
    print(f"warning: {message}", file=sys.stderr)


def _refuse(error: Exception, code: int) -> int:
    # A system's refusal has its number in front.
    text = error.strerror if isinstance(error, OSError) and error.strerror and not error.filename else error
    print(f"error: {text}", file=sys.stderr)
    return code


if __name__ == "__main__":
    sys.exit(main())

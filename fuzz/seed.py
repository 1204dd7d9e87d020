"""Writes what a run starts from into `fuzz/corpus/`: golden frames, scenarios and the beginnings of recordings."""

import json
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
CORPUS = ROOT / "fuzz/corpus"
PROFILES = ("classic", "fd")
# The identifiers of the default network, in the order of MessageKind::ALL.
IDENTIFIERS = (*range(0x200, 0x208), 0x701, 0x702, 0x081, 0x082, *range(0x208, 0x20C))
REMOTE, FD, LENGTH_IN_DATA = 2 << 5, 3 << 5, 1 << 7
# As much of a recording as a run with `-max_len=70000` takes.
BEGINNING = 60_000


def entry(text, length):
    """A frame as `cansend` writes it, as the target `protocol_receive` reads it; None for one that it can't be told."""
    number, rest = text.split("#", 1)
    if len(number) != 3 or int(number, 16) not in IDENTIFIERS:
        return None
    head = IDENTIFIERS.index(int(number, 16))
    if rest.startswith("R"):
        return bytes([head | REMOTE]) + bytes(length)
    head, data = (head | FD, rest[2:]) if rest.startswith("#") else (head, rest)
    data = bytes.fromhex(data)
    if len(data) == length:
        return bytes([head]) + data
    return bytes([head | LENGTH_IN_DATA]) + data if data and data[0] & 63 == len(data) else None


def lengths(cases):
    """The length of each message's frames in a profile."""
    accepted = [step["frame"] for case in cases for step in case["steps"] if step["result"] == "accepted"]
    split = [frame.split("#", 1) for frame in accepted]
    return {number: len(rest[2:] if rest.startswith("#") else rest) // 2 for number, rest in split}


def streams():
    """A file for each case of golden frames: the profile, then the frames that arrive."""
    for first, profile in enumerate(PROFILES):
        cases = json.loads((ROOT / f"firmware-protocol/vectors/{profile}.json").read_text())["cases"]
        length = lengths(cases)
        for number, case in enumerate(cases):
            frames = [step["frame"] for step in case["steps"] if step["result"] != "lost"]
            entries = [entry(frame, length.get(frame.split("#", 1)[0], 8)) for frame in frames]
            yield f"{profile}-{number}", bytes([first]) + b"".join(filter(None, entries))


def write(target, files):
    folder = CORPUS / target
    folder.mkdir(parents=True, exist_ok=True)
    written = [(folder / name).write_bytes(content) for name, content in files]
    print(f"{folder}: {len(written)} files")


if __name__ == "__main__":
    write("protocol_receive", streams())
    write("scenario", ((path.name, path.read_bytes()) for path in sorted(ROOT.glob("scenarios/*.toml"))))
    write("recording", ((path.stem, path.read_bytes()[:BEGINNING]) for path in sorted(ROOT.glob("recordings/*.mcap"))))

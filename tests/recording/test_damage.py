"""Recordings that are damaged, that lack records or have them twice, and those of other writers: no command ends with
exit code 0 unless all of its input was whole."""

import json
import os
import random
import re
import resource
import shutil
import signal
import stat
import struct
import subprocess
import time
from pathlib import Path

import mcap_files
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType, Writer
from processes import PATIENCE_S, RESONARM

ROOT = Path(__file__).resolve().parents[2]
SWEEP = ROOT / "recordings/free-sweep.mcap"
PROGRAM = ROOT / RESONARM
# How many damaged files are tried; by hand more.
MUTANTS = int(os.environ.get("RESONARM_MUTANTS", "30"))


def run(folder, *words, **more):
    words = [str(word) for word in (PROGRAM, *words)]
    return subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=PATIENCE_S, check=False, **more)


@pytest.fixture(scope="module")
def parts(tmp_path_factory):
    """A recording of several chunks, `one.mcap`, and the part of the run that follows, `two.mcap`."""
    folder = tmp_path_factory.mktemp("parts")
    (folder / "run.toml").write_text(
        "[excitation]\namplitude = { exciter_x = 10.0 }\n"
        'profile = { waveform = "swept-sine", from_hz = 5.0, to_hz = 60.0, duration_s = 3.0 }\n'
    )
    assert run(folder, "run", "--mode", "free", "--scenario", "run.toml", "--record", "run.mcap").returncode == 0
    assert run(folder, "cut", "run.mcap", "one.mcap", "--to-s", "2.5").returncode == 0
    assert run(folder, "cut", "run.mcap", "two.mcap", "--from-s", "2.501").returncode == 0
    return folder


# What uses a recording `x.mcap` in a folder that has a whole `one.mcap` and `two.mcap`.
COMMANDS = {
    "inspect": ["inspect", "x.mcap"],
    "resim": ["resim", "x.mcap"],
    "readings": ["resim", "x.mcap", "--readings"],
    "csv": ["export", "x.mcap", "--to", "csv", "--out", "csv", "--overwrite"],
    "candump": ["export", "x.mcap", "--to", "candump", "--out", "log", "--overwrite"],
    "cut": ["cut", "x.mcap", "part.mcap", "--overwrite"],
    "merge": ["merge", "x.mcap", "two.mcap", "--out", "merged.mcap", "--overwrite"],
    "identify": ["identify", "x.mcap"],
    "decode": ["protocol", "decode", "--recording", "x.mcap"],
    "diff": ["diff", "x.mcap", "one.mcap"],
}


def codes(folder):
    """The exit code of every command on `x.mcap`."""
    return {name: run(folder, *words).returncode for name, words in COMMANDS.items()}


def mutants(whole, count):
    """Damaged versions of a file, the same at every call: (what was done, bytes)."""
    chance = random.Random(7)
    found = mcap_files.records(whole)
    places = mcap_files.chunks(found)
    for number in range(count):
        # In turn, so that a few mutants already have all kinds.
        kind = number % 6
        data = bytearray(whole)
        # Between the magic bytes of both ends: a file without them is no recording at all, which would be too easy.
        place = chance.randrange(8, len(data) - 8)
        if kind == 0:
            bit = chance.randrange(8)
            data[place] ^= 1 << bit
            yield f"bit {bit} of byte {place}", bytes(data)
        elif kind == 1:
            yield f"cut at byte {place}", bytes(data[:place])
        elif kind == 2:
            length = chance.randrange(1, 300)
            del data[place : place + length]
            yield f"{length} bytes from byte {place} taken out", bytes(data)
        elif kind == 3:
            length = chance.randrange(1, 300)
            changed = bytes(byte ^ 0xFF for byte in data[place : place + length])
            data[place : place + length] = changed
            yield f"{length} bytes from byte {place} inverted", bytes(data)
        elif kind == 4:
            chunk = chance.choice(places)
            rest = found[:chunk] + found[chunk + 1 :]
            yield f"record {chunk}, a chunk, taken out, checksums right", mcap_files.file_of(mcap_files.without_index(rest))
        else:
            chunk, to = chance.choice(places), chance.choice(places)
            twice = [*found[: to + 1], found[chunk], *found[to + 1 :]]
            yield f"record {chunk}, a chunk, again behind {to}, checksums right", mcap_files.file_of(
                mcap_files.without_index(twice)
            )


def test_every_command_accepts_a_whole_recording(parts, tmp_path):
    for name in ("one.mcap", "two.mcap"):
        shutil.copy(parts / name, tmp_path)
    shutil.copy(parts / "one.mcap", tmp_path / "x.mcap")
    assert codes(tmp_path) == dict.fromkeys(COMMANDS, 0)


def test_no_command_ends_with_0_on_a_damaged_recording(parts, tmp_path):
    for name in ("one.mcap", "two.mcap"):
        shutil.copy(parts / name, tmp_path)
    wrong = []
    for what, data in mutants((parts / "one.mcap").read_bytes(), MUTANTS):
        (tmp_path / "x.mcap").write_bytes(data)
        for name, words in COMMANDS.items():
            for output in ("part.mcap", "merged.mcap"):
                (tmp_path / output).unlink(missing_ok=True)
            ended = run(tmp_path, *words)
            if ended.returncode not in (1, 2) or not ended.stdout + ended.stderr:
                wrong.append((what, name, ended.returncode, ended.stderr))
            for output in ("part.mcap", "merged.mcap"):
                # What was written does not claim to be whole.
                if (tmp_path / output).exists() and run(tmp_path, "inspect", output).returncode != 1:
                    wrong.append((what, name, f"{output} claims to be whole"))
    assert wrong == []


def test_what_a_flipped_bit_leaves_is_used_and_said_to_be_a_part(parts, tmp_path):
    data = bytearray((parts / "one.mcap").read_bytes())
    data[len(data) // 2] ^= 1
    (tmp_path / "x.mcap").write_bytes(data)
    exported = run(tmp_path, "export", "x.mcap", "--to", "csv")
    assert exported.returncode == 1 and "the recording is damaged" in exported.stderr
    assert len((tmp_path / "x-states.csv").read_text().splitlines()) > 1000
    cut = run(tmp_path, "cut", "x.mcap", "part.mcap")
    assert cut.returncode == 1 and "is damaged" in cut.stderr
    inspected = json.loads(run(tmp_path, "inspect", "part.mcap", "--json").stdout)
    assert inspected["integrity"] == {"state": "unfinished"}


# Recordings of other writers.


def rewritten(path, **options):
    """The sweep written by the package `mcap`, message by message."""
    with SWEEP.open("rb") as stream, path.open("wb") as target:
        reader = make_reader(stream)
        writer = Writer(target, **options)
        writer.start(library="another")
        schemas, channels = {}, {}
        metadata = list(reader.iter_metadata())
        for record in metadata:
            if record.name != "resonarm.lost":
                writer.add_metadata(record.name, record.metadata)
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            if schema.id not in schemas:
                schemas[schema.id] = writer.register_schema(schema.name, schema.encoding, schema.data)
            if channel.id not in channels:
                channels[channel.id] = writer.register_channel(
                    channel.topic, channel.message_encoding, schemas[schema.id], channel.metadata
                )
            writer.add_message(channels[channel.id], message.log_time, message.data, message.publish_time)
        for record in metadata:
            # What was lost is known only at the end, and there a recording states it.
            if record.name == "resonarm.lost":
                writer.add_metadata(record.name, record.metadata)
        writer.finish()


OTHER_WRITERS = {
    "no chunks": {"use_chunking": False},
    "no message index": {"index_types": IndexType.ALL & ~IndexType.MESSAGE},
    "no index": {"index_types": IndexType.NONE},
    "no statistics": {"use_statistics": False},
    "no summary offsets": {"use_summary_offsets": False},
    "no repeated channels": {"repeat_channels": False, "repeat_schemas": False},
    "no compression": {"compression": CompressionType.NONE},
    "many chunks of lz4": {"compression": CompressionType.LZ4, "chunk_size": 5000},
    "many chunks of zstd": {"compression": CompressionType.ZSTD, "chunk_size": 5000},
    "no checksums": {"enable_crcs": False, "enable_data_crcs": False},
    "data checksum": {"use_chunking": False, "enable_data_crcs": True},
}


@pytest.mark.parametrize("name", OTHER_WRITERS)
def test_valid_files_of_other_writers_are_read(name, tmp_path):
    rewritten(tmp_path / "x.mcap", **OTHER_WRITERS[name])
    inspected = run(tmp_path, "inspect", "x.mcap", "--json")
    assert json.loads(inspected.stdout)["integrity"] == {"state": "complete"}
    assert run(tmp_path, "diff", "x.mcap", SWEEP, "--parts", "states,samples,frames,events").returncode == 0
    resimulated = json.loads(run(tmp_path, "resim", "x.mcap", "--json").stdout)
    assert resimulated["identical"] and resimulated["samples"] == 1001


def test_a_wrong_byte_outside_chunks_is_found_by_the_checksum_of_the_data(tmp_path):
    rewritten(tmp_path / "x.mcap", use_chunking=False, enable_data_crcs=True)
    data = bytearray((tmp_path / "x.mcap").read_bytes())
    data[len(data) // 2] ^= 1
    (tmp_path / "x.mcap").write_bytes(data)
    said = run(tmp_path, "inspect", "x.mcap")
    assert said.returncode == 1 and "the checksum is" in said.stdout


def changed_footer(summary, offsets):
    """The sweep with these beginnings in its footer, whose checksum is left out."""
    data = bytearray(SWEEP.read_bytes())
    struct.pack_into("<QQI", data, len(data) - len(mcap_files.MAGIC) - 20, summary, offsets, 0)
    return bytes(data)


def bad_attachment():
    """The sweep with an attachment whose data are longer than any file."""
    found = mcap_files.records(SWEEP.read_bytes())
    body = struct.pack("<QQII", 0, 0, 0, 0) + struct.pack("<Q", 2**64 - 1) + bytes(4)
    place = mcap_files.chunks(found)[0]
    return mcap_files.file_of(mcap_files.without_index([*found[:place], (mcap_files.ATTACHMENT, body), *found[place:]]))


def altered_chunks(alter):
    """The sweep written by another, with these chunks."""

    def make(tmp_path):
        rewritten(tmp_path / "y.mcap", chunk_size=5000)
        found = mcap_files.without_index(mcap_files.records((tmp_path / "y.mcap").read_bytes()))
        return mcap_files.file_of(alter(found, mcap_files.chunks(found)))

    return make


def late_batch(tmp_path):
    """The sweep written by another without chunks, its first two batches of states exchanged."""
    rewritten(tmp_path / "y.mcap", use_chunking=False)
    found = mcap_files.without_index(mcap_files.records((tmp_path / "y.mcap").read_bytes()))
    topic = next(body[:2] for opcode, body in found if opcode == mcap_files.CHANNEL and b"/plant/steps" in body)
    one, two, *_ = (
        place for place, (opcode, body) in enumerate(found) if opcode == mcap_files.MESSAGE and body[:2] == topic
    )
    found[one], found[two] = found[two], found[one]
    return mcap_files.file_of(found)


UNREADABLE = {
    "summary beyond the file": lambda _: changed_footer(2**63, 2**63),
    "summary elsewhere": lambda _: changed_footer(100, 50),
    "endless attachment": lambda _: bad_attachment(),
    "without the last chunk": altered_chunks(lambda found, places: found[: places[-1]] + found[places[-1] + 1 :]),
    "a chunk twice": altered_chunks(lambda found, places: [*found[: places[1]], found[places[1]], *found[places[1] :]]),
    "a late batch": late_batch,
}


@pytest.mark.parametrize("name", UNREADABLE)
def test_inspect_does_not_call_complete_what_lacks_or_repeats_records_or_others_cannot_open(name, tmp_path):
    (tmp_path / "x.mcap").write_bytes(UNREADABLE[name](tmp_path))
    said = run(tmp_path, "inspect", "x.mcap")
    assert said.returncode == 1 and not re.search("integrity +complete", said.stdout)
    exported = run(tmp_path, "export", "x.mcap", "--to", "csv")
    assert exported.returncode in (1, 2) and "the recording is " in exported.stderr


def test_a_recording_without_its_last_chunk_says_how_many_samples_are_gone(parts, tmp_path):
    """Its own statistics count the samples of the run."""
    found = mcap_files.records((parts / "run.mcap").read_bytes())
    last = mcap_files.chunks(found)[-1]
    (tmp_path / "x.mcap").write_bytes(mcap_files.file_of(mcap_files.without_index(found[:last] + found[last + 1 :])))
    said = run(tmp_path, "inspect", "x.mcap")
    assert said.returncode == 1
    assert re.search(r"not whole: the statistics count 3\d{3} samples, but the file has \d+", said.stdout)
    assert run(tmp_path, "resim", "x.mcap").returncode == 1


# Outputs that are inputs, and outputs that are no files.

WALK = ["experiment", "walk", "--angles-deg", "0,60", "--drive", "joint1=20", "--points", "3", "--json"]
POSES, BAND = ["--over", "link2.angle_deg", "--from", "10", "--to", "20"], ["--from-hz", "10", "--to-hz", "11"]
ITSELF = {
    "identify": ("a.mcap", ["identify", "a.mcap", "--angles", "a.mcap", "--overwrite"]),
    "foxglove": ("x-foxglove.mcap", ["export", "x-foxglove.mcap", "--to", "foxglove", "--out", "x", "--overwrite"]),
    "csv": ("x-states.csv", ["export", "x-states.csv", "--to", "csv", "--out", "x", "--overwrite"]),
    "inspect": ("a.svg", ["inspect", "a.svg", "--plot", "a", "--overwrite"]),
    "cut": ("a.mcap", ["cut", "a.mcap", "link.mcap", "--overwrite"]),
    "merge": ("a.mcap", ["merge", "a.mcap", "a.mcap", "--out", "link.mcap", "--overwrite"]),
    "frf": ("s.csv", ["frf", "--scenario", "s.csv", "--plot", "s", "--overwrite"]),
    "modes": ("s.csv", ["modes", "--scenario", "s.csv", "--plot", "s", *POSES, "--overwrite"]),
    "backbone": ("s.csv", ["backbone", "--scenario", "s.csv", "--plot", "s", "--drive", "joint1=1", "--overwrite"]),
    "continue": ("s-curves.csv", ["continue", "--scenario", "s-curves.csv", "--plot", "s", "--drive", "joint1=1", "--overwrite"]),
    "sweep": ("sweep.csv", ["sweep", "--scenario", "sweep.csv", "--plot", "sweep", "--drive", "joint1=1", *BAND, "--overwrite"]),
    "run": ("s.toml", ["run", "--mode", "free", "--scenario", "s.toml", "--record", "link.toml", "--overwrite"]),
    "walk": ("s.toml", [*WALK, "--scenario", "s.toml", "--record", "s.toml", "--overwrite"]),
    "fmu": ("s.toml", ["fmu", "--scenario", "s.toml", "--out", "link.toml", "--overwrite"]),
}


# Those that read a scenario; the others read a recording.
COMPUTED = {"frf", "modes", "backbone", "continue", "sweep", "run", "walk", "fmu"}


@pytest.mark.parametrize("name", ITSELF)
def test_no_output_replaces_an_input(name, tmp_path):
    file, words = ITSELF[name]
    source = tmp_path / file
    shutil.copy(SWEEP.with_suffix(".toml") if name in COMPUTED else SWEEP, source)
    (tmp_path / f"link{source.suffix}").symlink_to(source.name)
    before = source.read_bytes()
    ended = run(tmp_path, *words)
    assert source.read_bytes() == before
    assert ended.returncode == 2 and "can't be written over itself" in ended.stderr, ended.stderr


def test_the_files_of_a_scenario_are_not_replaced(tmp_path):
    """Nor through a hard link."""
    (tmp_path / "pulse.csv").write_text("0\n0.1\n1e-3\n")
    (tmp_path / "s.toml").write_text(
        '[excitation]\namplitude = { exciter_x = 1.0 }\nprofile = { waveform = "file", path = "pulse.csv" }\n'
    )
    (tmp_path / "other.mcap").hardlink_to(tmp_path / "pulse.csv")
    words = ["run", "--mode", "free", "--scenario", "s.toml", "--record", "other.mcap", "--overwrite"]
    ended = run(tmp_path, *words)
    assert ended.returncode == 2 and "can't be written over itself" in ended.stderr, ended.stderr


def test_compare_does_not_replace_the_measured_points(tmp_path):
    (tmp_path / "walk.json").write_text("{}")
    ended = run(tmp_path, "compare", "walk.json", "--plot", "walk", "--overwrite")
    assert ended.returncode == 2 and "can't be written over itself" in ended.stderr
    assert (tmp_path / "walk.json").read_text() == "{}"


def test_a_file_that_is_replaced_keeps_its_mode(tmp_path):
    for name in ("free.mcap", "x-states.csv"):
        (tmp_path / name).write_text("old")
        (tmp_path / name).chmod(0o600)
    words = ["run", "--mode", "free", "--scenario", SWEEP.with_suffix(".toml"), "--record", "free.mcap", "--overwrite"]
    assert run(tmp_path, *words).returncode == 0
    assert run(tmp_path, "export", SWEEP, "--to", "csv", "--out", "x", "--overwrite").returncode == 0
    assert [stat.S_IMODE((tmp_path / name).stat().st_mode) for name in ("free.mcap", "x-states.csv")] == [0o600] * 2


FREE = ["run", "--mode", "free", "--scenario", SWEEP.with_suffix(".toml"), "--overwrite"]


def test_a_pipe_takes_a_whole_recording(tmp_path):
    os.mkfifo(tmp_path / "p")
    with (tmp_path / "p.mcap").open("wb") as target:
        reader = subprocess.Popen(["cat", tmp_path / "p"], stdout=target)
        assert run(tmp_path, *FREE, "--record", "p").returncode == 0
        assert reader.wait(PATIENCE_S) == 0
    assert run(tmp_path, "resim", "p.mcap").returncode == 0


def test_a_device_takes_a_recording(tmp_path):
    assert run(tmp_path, *FREE, "--record", "/dev/null").returncode == 0


def test_a_pipe_without_a_reader_is_left_at_the_first_signal(tmp_path):
    os.mkfifo(tmp_path / "p")
    words = [str(word) for word in (PROGRAM, *FREE, "--record", "p")]
    program = subprocess.Popen(words, cwd=tmp_path, stderr=subprocess.DEVNULL)
    # Until it is in open(2), as the kernel names the wait for the other end.
    until = time.monotonic() + PATIENCE_S
    while time.monotonic() < until and "wait_for_partner" not in Path(f"/proc/{program.pid}/wchan").read_text():
        # Where the kernel does not name what is waited for, that it sleeps must do.
        if Path(f"/proc/{program.pid}/stat").read_text().split(") ")[1][0] == "S":
            break
        time.sleep(0.01)
    program.send_signal(signal.SIGTERM)
    assert program.wait(PATIENCE_S) == -signal.SIGTERM


# Resources that run out.

LIMITED = {
    "inspect": ["inspect", SWEEP],
    "resim": ["resim", SWEEP],
    "run": ["run", "--mode", "free", "--scenario", SWEEP.with_suffix(".toml"), "--record", "f.mcap", "--overwrite"],
    "export": ["export", SWEEP, "--to", "csv", "--out", "x", "--overwrite"],
}


def limited(folder, words, kind, limit):
    return run(folder, *words, preexec_fn=lambda: resource.setrlimit(kind, (limit, limit)))


def check_limited(folder, name, kind, limits):
    for limit in limits:
        ended = limited(folder, LIMITED[name], kind, limit)
        # 127: the dynamic linker itself got no memory or descriptor.
        assert ended.returncode in (0, 3, 127), (limit, ended.returncode, ended.stderr)
        assert "panicked" not in ended.stderr, (limit, ended.stderr)


@pytest.fixture(scope="module")
def least_memory(tmp_path_factory):
    """The address space, bytes, with which the system can start the program at all, to a quarter of a MiB."""
    folder = tmp_path_factory.mktemp("least")
    low, high = 1 << 20, 1 << 30
    while high - low > 1 << 18:
        middle = (low + high) // 2
        if limited(folder, ["--version"], resource.RLIMIT_AS, middle).returncode == 0:
            high = middle
        else:
            low = middle
    return high


@pytest.mark.parametrize("name", LIMITED)
def test_memory_that_runs_out_is_no_verdict(name, least_memory, tmp_path):
    more = [kibibytes << 10 for kibibytes in (256, 700, 1500, 3000, 6000, 12000, 24000)]
    check_limited(tmp_path, name, resource.RLIMIT_AS, [least_memory + bytes for bytes in more])


def test_c_code_without_memory_is_no_verdict(least_memory, tmp_path):
    # With 3 to 5 MiB more Zstandard gets no context (a panic of zstd-safe), or glibc no entry for a thread's destructor (an
    # abort), within a few tens of KiB each.
    more = range(1 << 20, 6 << 20, 1 << 16)
    check_limited(tmp_path, "inspect", resource.RLIMIT_AS, [least_memory + bytes for bytes in more])


@pytest.mark.parametrize("name", LIMITED)
def test_descriptors_that_run_out_are_no_verdict(name, tmp_path):
    check_limited(tmp_path, name, resource.RLIMIT_NOFILE, range(3, 9))

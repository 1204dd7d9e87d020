"""Exports, read by the libraries they are for."""

import errno
import os
import re
import resource
import subprocess
import sys
from pathlib import Path

import can
import numpy as np
import pyarrow
import pytest
from asammdf import MDF
from pyarrow import csv, parquet

import resonarm
from resonarm import __main__ as program
from resonarm import export
from resonarm._staged import staged

ROOT = Path(__file__).resolve().parents[2]
SWEEP = ROOT / "recordings/free-sweep.mcap"


@pytest.fixture(scope="module")
def recording():
    return resonarm.Recording(SWEEP)


@pytest.fixture
def small_groups(monkeypatch):
    """Makes several row groups even of a short recording."""
    monkeypatch.setattr(export, "ROWS", 300)


TEXTS = {"direction": "string", "data": "string", "name": "string", "cause": "string"}
"""Columns of the CSV that aren't numbers, even if they look like some."""


def csv_of(command, recording, stem):
    """The tables of `resonarm export`, by part; a cell of numbers that is empty is null."""
    command("export", recording, "--to", "csv", "--out", stem)
    options = csv.ConvertOptions(column_types=TEXTS)
    return {
        path.stem.rpartition("-")[2]: csv.read_csv(path, convert_options=options)
        for path in stem.parent.glob(f"{stem.name}-*.csv")
    }


def is_csv(table, theirs):
    """Whether a table of Parquet has the columns and the cells of the CSV, in which truth values are 0 and 1, payloads
    hexadecimal digits, and texts that the recording doesn't have empty."""
    assert table.column_names == theirs.column_names
    for name in table.column_names:
        ours = table[name].to_pylist()
        if pyarrow.types.is_binary(table[name].type):
            ours = [data.hex().upper() for data in ours]
        if name == "cause":
            ours = [cause or "" for cause in ours]
        assert ours == theirs[name].to_pylist(), name


@pytest.mark.parametrize("name", ["free-sweep", "fd", "lockstep-dwell"])
def test_parquet_has_the_cells_of_the_csv(name, command, tmp_path, small_groups):
    recording = ROOT / f"recordings/{name}.mcap"
    theirs = csv_of(command, recording, tmp_path / "csv")
    written = export.export(recording, "parquet", tmp_path / "run")
    parts = ["states", "samples", "frames", "events"]
    assert [path.name for path in written] == [f"run-{part}.parquet" for part in parts]
    assert set(theirs) == set(parts)
    for part, path in zip(parts, written, strict=True):
        is_csv(parquet.read_table(path), theirs[part])
    rows = len(resonarm.Recording(recording).states)
    assert parquet.ParquetFile(tmp_path / "run-states.parquet").num_row_groups == -(-rows // 300)
    frames = parquet.read_table(tmp_path / "run-frames.parquet").to_pandas()
    assert set(frames["direction"]) == {"sent", "received"} and frames["time_s"].dtype == float
    is_unknown = resonarm.Recording(recording).frames["bus_unix_ns"] == 0
    assert frames["bus_unix_ns"].isna().tolist() == is_unknown.tolist()


def test_the_ticks_of_a_run_in_real_time_are_exported(bench_scenario, command, tmp_path):
    run = resonarm.run(
        bench_scenario.replace(simulation={"duration_s": 0.1}), "real-time", record=tmp_path / "run.mcap"
    )
    theirs = csv_of(command, run.recording.path, tmp_path / "csv")
    for path in export.export(run.recording.path, "parquet", tmp_path / "run"):
        is_csv(parquet.read_table(path), theirs.pop(path.stem.rpartition("-")[2]))
    assert not theirs and len(run.recording.read("ticks")) >= 100


def test_mf4_has_states_and_samples(recording, tmp_path, small_groups):
    (path,) = export.export(SWEEP, "mf4", tmp_path / "sweep")
    with MDF(path) as measured:
        for name, column in export.columns(recording.samples).items():
            if name != "time_s" and name != "sample" and name != "clipped":
                signal = measured.get(name)
                np.testing.assert_array_equal(signal.samples, column)
                np.testing.assert_array_equal(signal.timestamps, recording.samples["time_s"])
        assert measured.get("alpha1_rad").unit == "rad"
        assert measured.get("alpha1_dot_rad_s").unit == "rad/s"
        assert measured.get("acceleration_c_x_m_s2").unit == "m/s²"
        is_end = measured.get("is_end").samples
        assert is_end.dtype == np.uint8 and is_end.tolist() == [0] * (len(recording.states) - 1) + [1]


@pytest.mark.parametrize("name", ["free-sweep", "lockstep-dwell"])
def test_mf4_begins_when_the_run_began(name, tmp_path):
    """To the nanosecond; a run in simulated time alone, which has no date, at the beginning of 1970, UTC."""
    path = ROOT / f"recordings/{name}.mcap"
    start_unix_ns = resonarm.Recording(path).summary["origin"]["start_unix_ns"]
    assert (start_unix_ns is None) == (name == "free-sweep")
    (written,) = export.export(path, "mf4", tmp_path / "run")
    with MDF(written) as measured:
        assert measured.header.abs_time == (start_unix_ns or 0)
        assert measured.start_time.tzinfo is not None
        assert abs(measured.start_time.timestamp() - (start_unix_ns or 0) * 1e-9) < 1e-6


def test_blf_has_the_frames(recording, tmp_path):
    (path,) = export.export(SWEEP, "blf", tmp_path / "sweep")
    log, frames = list(can.LogReader(path)), recording.frames
    assert [message.arbitration_id for message in log] == frames["identifier"].tolist()
    assert [bytes(message.data) for message in log] == [recording.frame_data(row) for row in frames]


FULL = {"parquet": "full-states.parquet", "mf4": "full.mf4", "blf": "full.blf"}
"""The first file that doesn't fit, by format."""


def exported(to, folder, *words):
    """Runs the command on a disk that takes files of 10 kB, and returns its exit code and message."""
    limit = (10_240, 10_240)
    done = subprocess.run(
        [sys.executable, "-m", "resonarm", "export", SWEEP, "--to", to, "--out", folder / "full", *words],
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, limit),
    )
    return done.returncode, done.stderr


@pytest.mark.parametrize("to", FULL)
def test_a_full_disk_leaves_nothing(to, tmp_path):
    """And is no wrong input."""
    refusal = (3, f"error: can't write {tmp_path / FULL[to]}: File too large\n")
    assert exported(to, tmp_path) == refusal
    assert list(tmp_path.iterdir()) == []
    whole = export.export(SWEEP, to, tmp_path / "full")
    before = {path: path.read_bytes() for path in whole}
    assert exported(to, tmp_path, "--overwrite") == refusal
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_the_last_part_that_fails_leaves_no_other(tmp_path, monkeypatch):
    batches = resonarm.Recording.batches

    def until_the_events(recording, part, rows):
        if part == "events":
            raise OSError(errno.ENOSPC, "No space left on device")
        yield from batches(recording, part, rows)

    monkeypatch.setattr(resonarm.Recording, "batches", until_the_events)
    with pytest.raises(OSError, match="No space left on device"):
        export.export(SWEEP, "parquet", tmp_path / "sweep")
    assert list(tmp_path.iterdir()) == []


def test_a_name_that_is_taken_meanwhile_is_left(tmp_path):
    path = tmp_path / "sweep.blf"
    with pytest.raises(FileExistsError, match="already exists"), staged([path], False, SWEEP) as (partial,):
        assert re.fullmatch(r"\.sweep\.blf\.\d+\.0\.part", partial.name)
        path.write_text("theirs")
    assert {found: found.read_text() for found in tmp_path.iterdir()} == {path: "theirs"}


def test_a_link_stays_one_and_a_device_is_refused(tmp_path):
    (tmp_path / "far").mkdir()
    (tmp_path / "sweep.blf").symlink_to("far/log.blf")
    with pytest.raises(FileExistsError, match="already exists"):
        export.export(SWEEP, "blf", tmp_path / "sweep")
    export.export(SWEEP, "blf", tmp_path / "sweep", overwrite=True)
    assert (tmp_path / "sweep.blf").is_symlink() and (tmp_path / "far/log.blf").stat().st_size > 100
    for name, target in (("device", "/dev/null"), ("folder", "far")):
        (tmp_path / f"{name}.blf").symlink_to(target)
        with pytest.raises(FileExistsError, match=f"{name}.blf is not a regular file: give another stem"):
            export.export(SWEEP, "blf", tmp_path / name, overwrite=True)


def test_existing_files_are_kept(tmp_path):
    (tmp_path / "sweep.blf").write_text("mine")
    with pytest.raises(FileExistsError, match="--overwrite"):
        export.export(SWEEP, "blf", tmp_path / "sweep")
    assert (tmp_path / "sweep.blf").read_text() == "mine"
    assert program.main(["export", str(SWEEP), "--to", "blf", "--out", str(tmp_path / "sweep"), "--overwrite"]) == 0
    assert (tmp_path / "sweep.blf").stat().st_size > 100


MISSING = [errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EACCES, errno.EPERM, errno.EROFS]


@pytest.mark.parametrize("number", MISSING, ids=errno.errorcode.get)
def test_what_the_environment_lacks_is_no_wrong_input(number, tmp_path, capsys, monkeypatch):
    def refused(*_):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, "replace", refused)
    stem = tmp_path / "sweep\x1b[2J"
    assert program.main(["export", str(SWEEP), "--to", "blf", "--out", str(stem)]) == 3
    named = str(tmp_path / "sweep\\u{1b}[2J.blf")
    assert capsys.readouterr().err == f"error: can't write {named}: {os.strerror(number)}\n"
    assert list(tmp_path.iterdir()) == []


def test_an_input_or_a_folder_that_is_not_there_is_wrong_input(tmp_path, capsys, monkeypatch):
    out = tmp_path / "none/sweep"
    for to in export.FORMATS:
        assert program.main(["export", str(SWEEP), "--to", to, "--out", str(out)]) == 2
        assert re.search(rf"^error: can't write {out}\S*: No such file or directory\n$", capsys.readouterr().err)

    def unreadable(path):
        raise PermissionError(f"can't read recording `{path}`: Permission denied (os error 13)")

    # As the extension refuses it.
    monkeypatch.setattr(program, "Recording", unreadable)
    assert program.main(["export", str(SWEEP), "--to", "blf", "--out", str(tmp_path / "sweep")]) == 2
    assert "can't read recording" in capsys.readouterr().err


def test_the_command_says_what_is_wrong(tmp_path, capsys, monkeypatch):
    assert program.main(["export", str(tmp_path / "none.mcap"), "--to", "blf"]) == 2
    assert "can't read recording" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert program.main(["export", str(SWEEP), "--to", "parquet", "--out", str(tmp_path / "sweep")]) == 3
    assert capsys.readouterr().err == (
        "error: pyarrow is missing: python3 -m pip install 'asammdf>=8' 'pyarrow>=15' 'python-can>=4.4'\n"
    )
    with pytest.raises(SystemExit):
        program.main(["export", str(SWEEP), "--to", "xls"])


def test_the_package_runs():
    words = [sys.executable, "-m", "resonarm", "--version"]
    said = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    assert said == f"resonarm {resonarm.__version__}\n"

"""Exports, read by the libraries they are for."""

import subprocess
import sys
from pathlib import Path

import can
import numpy as np
import pytest
from asammdf import MDF
from pyarrow import csv, parquet

import resonarm
from resonarm import __main__ as program
from resonarm import export

ROOT = Path(__file__).resolve().parents[2]
SWEEP = ROOT / "recordings/free-sweep.mcap"


@pytest.fixture(scope="module")
def recording():
    return resonarm.Recording(SWEEP)


@pytest.fixture
def small_groups(monkeypatch):
    """Makes several row groups even of a short recording."""
    monkeypatch.setattr(export, "ROWS", 300)


def test_parquet_has_the_numbers_of_the_csv(command, tmp_path, small_groups):
    command("export", SWEEP, "--to", "csv", "--out", tmp_path / "csv")
    written = export.export(SWEEP, "parquet", tmp_path / "sweep")
    assert [path.name for path in written] == [
        f"sweep-{part}.parquet" for part in ("states", "samples", "frames", "events")
    ]
    for part in ("states", "samples"):
        ours, theirs = (
            parquet.read_table(tmp_path / f"sweep-{part}.parquet"),
            csv.read_csv(tmp_path / f"csv-{part}.csv"),
        )
        assert ours.column_names == theirs.column_names
        for name in ours.column_names:
            column = ours[name].to_numpy()
            if name != "is_end" and name != "clipped":
                np.testing.assert_array_equal(column, theirs[name].to_numpy(), name)
    assert parquet.ParquetFile(tmp_path / "sweep-states.parquet").num_row_groups == 4
    frames = parquet.read_table(tmp_path / "sweep-frames.parquet")
    assert set(map(len, frames["data"].to_pylist())) <= {1, 8}


def test_the_ticks_of_a_run_in_real_time_are_exported(bench_scenario, tmp_path):
    run = resonarm.run(
        bench_scenario.replace(simulation={"duration_s": 0.1}), "real-time", record=tmp_path / "run.mcap"
    )
    written = export.export(run.recording.path, "parquet", tmp_path / "run")
    assert "run-ticks.parquet" in [path.name for path in written]
    table, ticks = parquet.read_table(tmp_path / "run-ticks.parquet"), run.recording.read("ticks")
    assert len(ticks) >= 100
    for name in ticks.dtype.names:
        np.testing.assert_array_equal(table[name].to_numpy(), ticks[name], name)


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


def test_blf_has_the_frames(recording, tmp_path):
    (path,) = export.export(SWEEP, "blf", tmp_path / "sweep")
    log, frames = list(can.LogReader(path)), recording.frames
    assert [message.arbitration_id for message in log] == frames["identifier"].tolist()
    assert [bytes(message.data) for message in log] == [recording.frame_data(row) for row in frames]


def test_existing_files_are_kept(tmp_path):
    (tmp_path / "sweep.blf").write_text("mine")
    with pytest.raises(FileExistsError, match="--overwrite"):
        export.export(SWEEP, "blf", tmp_path / "sweep")
    assert (tmp_path / "sweep.blf").read_text() == "mine"
    assert program.main(["export", str(SWEEP), "--to", "blf", "--out", str(tmp_path / "sweep"), "--overwrite"]) == 0
    assert (tmp_path / "sweep.blf").stat().st_size > 100


def test_the_command_says_what_is_wrong(tmp_path, capsys, monkeypatch):
    assert program.main(["export", str(tmp_path / "none.mcap"), "--to", "blf"]) == 2
    assert "can't read recording" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    assert program.main(["export", str(SWEEP), "--to", "parquet", "--out", str(tmp_path / "sweep")]) == 3
    assert capsys.readouterr().err == "error: pyarrow is missing: python3 -m pip install 'resonarm[export]'\n"
    with pytest.raises(SystemExit):
        program.main(["export", str(SWEEP), "--to", "xls"])


def test_the_package_runs():
    words = [sys.executable, "-m", "resonarm", "--version"]
    said = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    assert said == f"resonarm {resonarm.__version__}\n"

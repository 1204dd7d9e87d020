"""The demo, as a user runs it: once, without a bus of this machine."""

import struct
import xml.etree.ElementTree as ElementTree
from types import SimpleNamespace

import numpy as np
import pytest
from processes import Programs
from recordings import Recording

# scenarios/demo.toml: 20 points of a walk at 14 N along x.
POINTS = 20
FORCE_N = 14
# The displacements that are compared, of C and of B.
READ = ("tip.x", "joint2.x")


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    folder = tmp_path_factory.mktemp("demo")
    with Programs() as programs:
        run = programs.resonarm("demo", "--json", "--out", folder)
        return SimpleNamespace(said=run.result(300), folder=folder, recording=Recording.whole(folder / "demo.mcap"))


def test_the_points_are_those_of_the_branch(demo):
    points = demo.said["points"]
    assert len(points) == POINTS and all(point["settled"] for point in points)
    with Programs() as programs:
        arm = ("--angles-deg", "30,60", "--drive", f"tip.x={FORCE_N}", "--at", ",".join(READ), "--most-points", 100000)
        span = ("--from-hz", 22.0, "--to-hz", 22.3, "--largest-step", 0.002)
        branch = programs.resonarm("continue", *arm, *span, "--json").result(120)["points"]
    amplitudes = [[point["readings"][name]["amplitude"] for name in READ] for point in branch]
    computed = np.column_stack([[point["frequency_hz"] for point in branch], amplitudes])
    stable = np.array([point["stable"] for point in branch])
    seen = set()
    for point in points:
        read = np.array([point["frequency_hz"], *(point["readings"][name]["amplitude"] for name in READ)])
        # In units of 2e-5 in frequency and of 0.2 % in amplitude, at the noise of the default instruments.
        distance = np.linalg.norm((computed / read - 1) / [2e-5, 2e-3, 2e-3], axis=1)
        assert distance.min() < 1.2, point
        seen.add(bool(stable[distance.argmin()]))
        assert abs(point["excitation"] / FORCE_N - 1) < 2e-3
    assert seen == {True, False}
    lags = [point["lag_deg"] for point in points]
    assert np.allclose(lags, np.linspace(24, 144, POINTS), atol=0.6)


def test_the_recording_is_whole_and_of_the_same_run(demo):
    assert demo.said["recording"] == str(demo.folder / "demo.mcap")
    samples = demo.said["samples"]
    assert 20_000 < samples < 50_000 and demo.said["outcome"] == "disarmed"
    lost = int(demo.recording.metadata["resonarm.lost"]["plant"])
    assert (lost, len(demo.recording.states)) == (0, samples)
    assert demo.said["pacing"]["speed"] == 1 and demo.said["wakeup_us"]["max"] > 0


def test_it_simulates_again_bit_for_bit(demo):
    with Programs() as programs:
        assert programs.resonarm("resim", demo.folder / "demo.mcap", "--json").result()["identical"]


def test_the_figures_are_pictures(demo):
    svg, png, caption = (demo.folder / f"response.{kind}" for kind in ("svg", "png", "txt"))
    assert demo.said["figures"] == [str(svg), str(png), str(caption)] and caption.read_text().strip()
    picture = ElementTree.parse(svg).getroot()
    assert picture.tag == "{http://www.w3.org/2000/svg}svg"
    words = " ".join(text for text in picture.itertext())
    assert "Phase walk over the resonance" in words and "frequency (Hz)" in words
    content = png.read_bytes()
    assert content[:8] == b"\x89PNG\r\n\x1a\n"
    width, height = struct.unpack(">II", content[16:24])
    assert width >= 600 and height >= 400

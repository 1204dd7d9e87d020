"""The demo, as a user runs it: once, without a bus of this machine."""

import struct
import xml.etree.ElementTree as ElementTree
from types import SimpleNamespace

import numpy as np
import pytest
from linear_arm import LinearArm
from processes import Programs
from recordings import Recording

# scenarios/demo.toml: 17 steps of a force along x, and joints with 200 times the damping of Table 1.
FREQUENCIES_HZ = np.linspace(18, 26, 17)
ARM = LinearArm(beta1_deg=30, beta2_deg=60, d1=180, d2=180)
FORCE_N = 20


@pytest.fixture(scope="module")
def demo(tmp_path_factory):
    folder = tmp_path_factory.mktemp("demo")
    with Programs() as programs:
        run = programs.resonarm("demo", "--json", "--out", folder)
        return SimpleNamespace(said=run.result(120), folder=folder, recording=Recording.whole(folder / "demo.mcap"))


def test_responses_are_those_of_linear_theory(demo):
    responses = demo.said["responses"]
    assert [response["frequency_hz"] for response in responses] == pytest.approx(FREQUENCIES_HZ)
    for response in responses:
        measured = [np.linalg.norm(response[f"acceleration_{point}_m_s2"]) for point in "bc"]
        force_n = np.linalg.norm(response["head_force_n"])
        of_b, of_c = ARM.accelerations(response["frequency_hz"], [1.0, 0.0]).reshape(2, 2)
        expected = [np.linalg.norm(of_b), np.linalg.norm(of_c)]
        near = np.allclose(np.array(measured) / force_n, expected, rtol=0.05)
        assert near and response["settled"] and abs(force_n - FORCE_N) < 0.5, response


def test_the_recording_is_whole_and_of_the_same_run(demo):
    assert demo.said["recording"] == str(demo.folder / "demo.mcap")
    samples = demo.said["samples"]
    assert samples > 17 * 1200 and demo.said["outcome"] == "disarmed"
    lost = int(demo.recording.metadata["resonarm.lost"]["plant"])
    assert (lost, len(demo.recording.steps)) == (0, samples)
    assert demo.said["pacing"]["speed"] == 1 and demo.said["wakeup_us"]["max"] > 0


def test_it_simulates_again_bit_for_bit(demo):
    with Programs() as programs:
        assert programs.resonarm("resim", demo.folder / "demo.mcap", "--json").result()["identical"]


def test_the_figures_are_pictures(demo):
    svg, png = (demo.folder / f"response.{kind}" for kind in ("svg", "png"))
    assert demo.said["figures"] == [str(svg), str(png)]
    picture = ElementTree.parse(svg).getroot()
    assert picture.tag == "{http://www.w3.org/2000/svg}svg"
    words = " ".join(text for text in picture.itertext())
    assert "Stepped sine through the first resonance" in words and "frequency (Hz)" in words
    content = png.read_bytes()
    assert content[:8] == b"\x89PNG\r\n\x1a\n"
    width, height = struct.unpack(">II", content[16:24])
    assert width >= 600 and height >= 400

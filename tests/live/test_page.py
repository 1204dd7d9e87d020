"""The page of the live view in Chromium, as a user sees it: runs, plots, steering."""

import json
import re
import signal
import struct
import time
import zlib
from pathlib import Path

from live_view import SMALL_RANGE, address, free_run, open_page
from processes import free_port, wait_until

# A phone's screen, CSS pixels.
PHONE = {"width": 390, "height": 844, "touch": True}

# Whether the elements of a section are one below the other.
IN_ORDER = """[...document.querySelectorAll('section')].every((section) => {
    if (['controls', 'display'].includes(section.id)) return true;
    const parts = [...section.querySelectorAll('h2, canvas, p, ol')];
    const shown = parts.map((part) => part.getBoundingClientRect()).filter((part) => part.height > 0);
    return shown.every((part, k) => k === 0 || part.top >= shown[k - 1].bottom - 1);
})"""


def test_every_event_that_the_documents_name_has_words():
    """Without words the page shows the name in the recording, which a reader has to look up."""
    root = Path(__file__).parents[2]
    section = (root / "docs/recording.md").read_text().partition("### Events")[2].partition("###")[0]
    names = re.findall(r"`([a-z]+\.[a-z_.]+)`", section)
    words = (root / "crates/live/src/page/events.js").read_text()
    assert len(names) > 8 and [name for name in names if f'"{name}":' not in words] == []


def colours_of_png(content):
    """The different colours of a picture of 8 bits a channel, by a reader of a few lines."""
    assert content[:8] == b"\x89PNG\r\n\x1a\n"
    width, height, depth, kind = struct.unpack(">IIBB", content[16:26])
    assert depth == 8
    data, at = b"", 8
    while at < len(content):
        length, name = struct.unpack(">I4s", content[at : at + 8])
        data += content[at + 8 : at + 8 + length] if name == b"IDAT" else b""
        at += 12 + length
    lines, channels = zlib.decompress(data), {2: 3, 6: 4}[kind]
    return width, height, len({lines[k : k + 3] for k in range(1, len(lines) - 3, channels)})


def test_the_demo_moves_and_its_response_builds_up_on_the_branch(browser, programs, tmp_path):
    # At half the speed of the clock, so that there is time to look.
    demo = programs.resonarm("demo", "--speed", 0.5, "--live", "--out", tmp_path)
    page = open_page(browser, demo, height=1500)
    assert page.text("#state") == "armed"
    assert page.text("#what").startswith("plant and exciter on a bus in memory: irb1600-fitted")
    page.until("resonarm.data.points.length >= 6 && resonarm.data.branch?.unstable.length > 10")
    page.until("resonarm.data.spectrum && resonarm.data.times.length > 100")
    # Every point lies on the computed branch, which has both folds' stretches by then.
    assert page.value("""(() => {
        const { branch, points } = resonarm.data;
        const lines = [...branch.stable, ...branch.unstable].filter((point) => point !== null);
        return points.every((point) => lines.some(([hz, x]) =>
            Math.abs(hz - point.frequency_hz) < 2e-3 && Math.abs(x / point.amplitude[0] - 1) < 0.05));
    })()""")
    peak_hz = page.value("resonarm.data.spectrum.peak_hz")
    assert abs(peak_hz - 22.15) < 0.1
    plots = ("#structure", "#lissajous", "#response", "#force canvas", "#acceleration-c canvas", "#spectrum canvas")
    for canvas in plots:
        seen = page.pixels(canvas)
        assert seen["colours"] > 20 and seen["drawn"] > 0.005, (canvas, seen)
    tips = set()
    tip = "resonarm.views.structure.tip.map(Math.round).join()"
    wait_until(lambda: tips.add(page.value(tip)) or len(tips) > 8, "the arm to move")
    assert re.match(r"load [\d.]+ %, \d+ µs late, 1 viewer, \d+ records? and ", page.text("#timing-numbers"))
    assert page.text("#overruns") == "0 deadlines missed"
    assert page.value(IN_ORDER)
    width, height, colours = colours_of_png(page.picture(tmp_path / "demo.png"))
    assert (width, height) == (1280, 1500) and colours > 100
    assert page.errors == []


def test_it_works_on_a_phone_in_the_dark_and_by_keyboard(browser, programs, tmp_path):
    run = free_run(programs)
    page = open_page(browser, run, dark=True, **PHONE)
    page.until("resonarm.data.times.length > 50")
    assert page.value("document.documentElement.scrollWidth") <= PHONE["width"], "it is wider than the screen"
    wide = "(it) => it.getBoundingClientRect().width > 340"
    assert page.value(f"[...document.querySelectorAll('section:not([hidden])')].every({wide})")
    assert page.value(IN_ORDER)
    assert page.value("getComputedStyle(document.body).backgroundColor") == "rgb(20, 23, 26)"
    # Whatever can be clicked can be reached by Tab, and shows that it is.
    reached = set()
    for _ in range(60):
        page.press("Tab")
        reached.add(page.value("document.activeElement.id || document.activeElement.dataset?.request || ''"))
    assert {"disarm", "set-load", "to-scale", "slow", "hold", "span", "events"} <= reached, reached
    page.value("document.getElementById('to-scale').focus()")
    page.press(" ")
    page.until("document.getElementById('structure-scale').textContent === 'to scale'")
    page.picture(tmp_path / "phone.png")
    assert page.errors == []


def test_the_page_keeps_up_with_a_run_at_1_khz(browser, programs):
    """How many pictures a second are drawn depends on the machine, which may stop any process, and is only printed;
    every sample comes, for three seconds without a gap, does not."""
    page = open_page(browser, free_run(programs))
    look = "[performance.now(), resonarm.data.frames, resonarm.data.drawing_ms]"
    begun_ms, first, drawn_ms = page.value(look)
    page.until(f"resonarm.data.frames >= {first} + 150 && resonarm.data.rows.length >= 3000")
    ended_ms, last, drawing_ms = page.value(look)
    a_second = 1000 * (last - first) / (ended_ms - begun_ms)
    print(f"{a_second:.1f} pictures a second, {(drawing_ms - drawn_ms) / (last - first):.2f} ms a picture")
    assert page.errors == []


# The causes as a run's summary names them, in its order.
CAUSES = {
    "stolen": "while the host had the core",
    "preempted": "while other threads had the core",
    "woke_late": "woke late",
    "step_long": "step long",
    "bus_long": "bus long",
}


def recorded_with_missed_deadlines(programs, folder):
    """What a run in real time says of itself that was stopped while it went, and its recording. Ten stops of thirty
    periods each miss deadlines, whatever else the machine does. With timeouts of a minute and a small load, which the
    walk can't raise to a limit however late its answers are, the run continues."""
    scenario = folder / "patient.toml"
    walk = Path("scenarios/demo.toml").read_text().replace("exciter_x = 14.0", "exciter_x = 0.1")
    timeouts = "[network]\ncommand_timeout_s = 60.0\npartner_timeout_s = 60.0\n"
    scenario.write_text(walk.replace("[network]\n", timeouts))
    demo = programs.resonarm("demo", "--mode", "real-time", "--scenario", scenario, "--out", folder, "--json")
    recording = folder / "demo.mcap"
    # Records of half a second are written at once: by then it is under way.
    wait_until(lambda: recording.exists() and recording.stat().st_size > 50_000, "the run to be under way")
    for _ in range(10):
        demo.process.send_signal(signal.SIGSTOP)
        time.sleep(0.03)
        demo.process.send_signal(signal.SIGCONT)
        time.sleep(0.05)
    assert demo.running(), demo.stderr
    demo.stop()
    return json.loads(demo.stdout), recording


def test_missed_deadlines_are_shown_with_their_causes(browser, programs, tmp_path):
    said, recording = recorded_with_missed_deadlines(programs, tmp_path)
    counts = said["overrun_causes"]
    causes = [f"{counts[cause]} {words}" for cause, words in CAUSES.items() if counts[cause]]
    assert said["overruns"] >= 10 and causes
    page = open_page(browser, programs.resonarm("replay", recording, "--live"), **PHONE)
    all_of_them = f"{said['overruns']} deadlines missed: {', '.join(causes)}"
    shown = "document.getElementById('overruns').textContent"
    page.until(f"{shown} === {json.dumps(all_of_them)}")
    # When played again they are counted from zero: fewer at the start, where a stopped machine may have missed some.
    page.value("resonarm.ask('pause')")
    page.value("resonarm.ask({ seek: { time_s: 0 } })")
    page.until(f"Number.parseInt({shown} || '0') < {said['overruns']}")
    page.value("resonarm.ask('play')")
    page.until(f"{shown} === {json.dumps(all_of_them)}")
    assert page.value(IN_ORDER) and page.value("document.documentElement.scrollWidth") <= PHONE["width"]
    page.value("document.getElementById('timing').scrollIntoView()")
    page.picture(tmp_path / "missed.png")
    assert page.errors == []


def test_a_run_is_disarmed_from_the_page_and_records_it(browser, programs, tmp_path):
    recording = tmp_path / "run.mcap"
    run = free_run(programs, "--record", recording, "--json")
    page = open_page(browser, run)
    page.until("document.getElementById('state').textContent === 'armed'")
    page.value("document.querySelector('[data-request=disarm]').click()")
    said = run.result()
    assert said["outcome"] == "disarmed" and said["exciter"]["outcome"] == "stopped"
    page.until("document.getElementById('link').textContent === 'the run is over'")
    assert "disarming was requested in the live view" in page.text("#events")
    exported = programs.resonarm("export", recording, "--to", "csv", "--parts", "events", "--out", tmp_path / "out")
    assert exported.wait() == 0, exported.stderr
    table = (tmp_path / "out-events.csv").read_text()
    assert "request.disarm" in table and "state.pre_operational" in table
    assert page.errors == []


def test_without_the_token_one_can_only_look(browser, programs):
    run = free_run(programs)
    url, _ = address(run)
    page = browser.page(url)
    page.until("window.resonarm?.data?.frames > 3")
    assert page.value("document.getElementById('operate').disabled")
    assert page.text("#answer").startswith("To steer, open the whole address")
    page.value("document.querySelector('[data-request=disarm]').click()")
    page.until("resonarm.data.frames > 30")
    assert run.running() and page.text("#state") == "armed"
    assert page.errors == []


def test_behind_a_server_that_ends_tls_the_page_works_as_well(browser, programs, tmp_path):
    port = free_port()
    origin = programs.tls(tmp_path, port)
    _, token = address(free_run(programs, "--live-origin", origin, live=f"127.0.0.1:{port}"))
    page = browser.page(f"{origin}/#{token}", any_certificate=True)
    page.until("window.resonarm?.data?.frames > 3")
    assert page.errors == []


def test_set_points_lead_the_force_and_its_response_is_read(browser, programs):
    run = free_run(programs)
    page = open_page(browser, run)
    fill = """for (const [id, value] of Object.entries({load: 12, frequency: 15, phase: 0}))
        document.getElementById(`set-${id}`).value = value;
        document.querySelector('#set-point button').click()"""
    page.value(fill)
    page.until("document.getElementById('answer').textContent === ''")
    page.until("Math.max(...resonarm.data.largest[2].slice(-20)) > 11.9")
    point = page.until("resonarm.data.points[0]")
    assert point["frequency_hz"] == 15 and abs(point["load"] - 12) < 0.05
    names = page.value("[...document.querySelectorAll('#events li')].map((it) => it.textContent).join('|')")
    assert "set-point requested: load 12 N" in names and "set-point requested: frequency 15 Hz" in names
    page.value(fill.replace("load: 12", "load: 1e6"))
    # The page itself refuses it by its limits, the program too.
    assert not page.value("document.getElementById('set-point').checkValidity()")
    page.value("resonarm.ask({ set: { load: 1e6, frequency_hz: 15, phase_deg: 0 } })")
    wait_until(lambda: page.text("#answer").startswith("the load is 1000000 N: it must be from 0 to"), "the refusal")
    assert page.errors == []


# The notes beside the titles of the panels, by panel.
CLIPPED = ("force", "b", "c", "lissajous", "spectrum", "structure")
# How many pixels of a canvas have the colour of what is wrong, but for what the edge of a line takes of it.
BAD_PIXELS = """((selector) => {
    const canvas = document.querySelector(selector);
    const copy = new OffscreenCanvas(canvas.width, canvas.height).getContext('2d', { willReadFrequently: true });
    copy.drawImage(canvas, 0, 0);
    const pixels = copy.getImageData(0, 0, canvas.width, canvas.height).data;
    const near = (k) => [0xb3, 0x26, 0x1e, 0xff].every((value, at) => Math.abs(pixels[k + at] - value) < 16);
    let count = 0;
    for (let k = 0; k < pixels.length; k += 4) count += near(k);
    return count;
})"""
# The arm as an exciter draws it, which knows no angles and computes them from the accelerations.
AS_AN_EXCITER = """(() => {
    const { rows, rowsClipped, newest, about } = resonarm.data;
    const unknown = rows.map((row) => row.map((number, channel) => (channel < 10 ? number : NaN)));
    resonarm.views.structure.draw(unknown, rowsClipped, newest, about, 15, { toScale: false, slow: false });
    return document.getElementById('structure-clipped').textContent;
})()"""


def test_clipped_readings_are_marked_wherever_they_are_shown(browser, programs, tmp_path):
    scenario = tmp_path / "small_range.toml"
    scenario.write_text(SMALL_RANGE.format(0.2))
    page = open_page(browser, free_run(programs, "--scenario", scenario))
    notes = lambda: [page.text(f"#{panel}-clipped") for panel in CLIPPED]
    page.until("resonarm.data.spectrum")
    assert notes() == [""] * len(CLIPPED)
    assert [page.value(f"{BAD_PIXELS}('{panel}')") for panel in ("#acceleration-c canvas", "#lissajous")] == [0, 0]
    page.value("resonarm.ask({ set: { load: 30, frequency_hz: 15, phase_deg: 0 } })")
    # Both axes of C, and none of B.
    assert page.until("resonarm.data.points[0]")["clipped"] == [True, True, False, False]
    both = "clipped: C x, C y"
    expected = [["", "", "clipped: x, y", along, both, ""] for along in ("clipped: C x", "clipped: C y")]
    wait_until(lambda: notes() in expected, "the notes beside the titles")
    page.until(f"{AS_AN_EXCITER} === '{both}'")
    for panel in ("#acceleration-c canvas", "#lissajous", "#response"):
        page.until(f"{BAD_PIXELS}('{panel}') > 10")
    assert page.value(f"{BAD_PIXELS}('#acceleration-b canvas')") == 0
    page.picture(tmp_path / "clipped.png")
    assert page.errors == []

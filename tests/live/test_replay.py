"""A recording in the live view: its time bar, how it begins and how it ends."""

import time
import urllib.request

import pytest
from live_view import Viewer, address, open_page
from processes import PATIENCE_S, wait_until

DWELL = "recordings/lockstep-dwell.mcap"
# Its last sample, at 1 kHz.
LAST = 900


def replay(programs, *arguments, recording=DWELL):
    return programs.resonarm("replay", recording, "--live", *arguments)


def at(page, sample):
    """Waits until a sample is shown: by the time, by the bar, and by the last of what is drawn."""
    bar = "document.getElementById('seek').valueAsNumber"
    page.until(f"resonarm.data.head.time_s === {sample} / 1000 && {bar} === {sample}")
    return page.value("[resonarm.data.newest, resonarm.data.rows.length > 0, resonarm.data.player.playing]")


def halted(page):
    page.value("resonarm.ask('pause')")
    page.until("document.getElementById('play').textContent === 'Play'")


def test_a_recording_is_shown_with_a_time_bar(browser, programs):
    program = replay(programs)
    page = open_page(browser, program)
    assert page.value("!document.getElementById('player').hidden && document.getElementById('set-point').hidden")
    page.until("resonarm.data.head.time_s > 0.3")
    halted(page)
    page.value("(() => { const bar = document.getElementById('seek'); bar.value = 700; "
               "bar.dispatchEvent(new Event('input')); })()")  # fmt: skip
    assert at(page, 700) == [700, True, False]
    page.value("document.getElementById('play').click()")
    page.until(f"resonarm.data.head.time_s === {LAST} / 1000")
    page.until("document.getElementById('play').textContent === 'Play'")
    page.value("resonarm.ask({ speed: { times: 0.25 } })")
    page.value("document.getElementById('play').click()")
    # From its beginning.
    page.until("resonarm.data.head.time_s > 0.05 && resonarm.data.head.time_s < 0.8 && resonarm.data.times[0] < 0.05")
    assert page.value("document.getElementById('speed').value") == "0.25"
    assert page.errors == []
    assert program.stop() == 0


def test_the_time_bar_works_while_the_recording_is_halted_also_by_keys(browser, programs):
    page = open_page(browser, replay(programs))
    halted(page)
    page.value("document.getElementById('seek').focus()")
    shown = []
    for keys, sample in [
        (["Home"], 0), (["ArrowRight"] * 20, 20), (["PageUp"], 110), (["End"], LAST), (["ArrowLeft"], LAST - 1),
        ([","] * 3, LAST - 4), (["."], LAST - 3),
    ]:  # fmt: skip
        page.press(*keys)
        shown.append((sample, at(page, sample)))
    assert shown == [(sample, [sample, True, False]) for sample, _ in shown]
    assert page.value("document.getElementById('seek').getAttribute('aria-valuetext')") == "0.897 s"
    # What was before is drawn as well, and of the arm the sample that is shown.
    # Samples 0 to 897, which make 89 whole stretches of ten.
    assert page.value("[resonarm.data.times[0], resonarm.data.times.length, resonarm.data.rows.length]") == [0, 89, 898]
    tips, tip = set(), "[resonarm.data.frames, resonarm.views.structure.tip.join()]"
    first, _ = page.value(tip)
    wait_until(lambda: (shown := page.value(tip)) and tips.add(shown[1]) or shown[0] > first + 20, "twenty pictures")
    assert len(tips) == 1
    page.value("document.querySelector('[data-step=\"1\"]').click()")
    assert at(page, LAST - 2) == [LAST - 2, True, False]
    page.value("document.querySelector('[data-step=\"-1\"]').click()")
    assert at(page, LAST - 3) == [LAST - 3, True, False]
    assert page.errors == []


def test_a_recording_waits_for_its_first_viewer(programs):
    program = replay(programs, "--wait")
    url, token = address(program)
    begun = time.monotonic()
    # Longer than the recording is. Who takes the page and its files does not look yet.
    while time.monotonic() < begun + 1.5:
        urllib.request.urlopen(url, timeout=PATIENCE_S).close()
        time.sleep(0.05)
    viewer = Viewer(url, token)
    assert viewer.next("player") == {"kind": "player", "playing": False, "speed": 1, "sample": 0}
    samples = []
    while samples[-1:] != [LAST]:
        message = viewer.next("update")
        samples += range(message["first"], message["first"] + message["rows"])
    assert samples == list(range(LAST + 1))
    over = {"kind": "player", "playing": False, "speed": 1, "sample": LAST}
    wait_until(lambda: Viewer(url).next("player") == over, "the end")


def test_a_recording_that_is_over_is_shown_as_a_whole_to_whoever_comes(browser, programs):
    program = replay(programs)
    first = Viewer(*address(program))
    first.next("player", lambda message: not message["playing"])
    page = open_page(browser, program)
    assert at(page, LAST) == [LAST, True, False]
    assert page.value("[resonarm.data.times.length, resonarm.data.rows.length]") == [90, LAST + 1]
    assert page.pixels("#lissajous")["drawn"] > 0.005
    assert page.errors == []


def test_a_recording_is_played_as_often_and_as_fast_as_is_asked_for(programs):
    viewer = Viewer(*address(replay(programs, "--wait", "--loop", 3, "--speed", 4)))
    assert viewer.next("player")["speed"] == 4
    for _ in range(2):
        viewer.next("restarted")
    viewer.next("player", lambda message: not message["playing"] and message["sample"] == LAST)


def test_orders_beyond_the_recording_are_refused(programs):
    viewer = Viewer(*address(replay(programs)))
    beyond = "the time is 0.901 s: it must be from 0 to 0.9 s"
    assert viewer.ask({"seek": {"time_s": 0.901}}) == {"kind": "refused", "why": beyond}
    assert viewer.ask({"seek": {"time_s": 0.9}}) == {"kind": "taken"}
    assert viewer.ask({"step": {"samples": 0.5}})["kind"] == "refused"


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (["--speed", "0"], "--speed is 0: with --live it must be from 0.001 to 1000"),
        (["--from-s", "0.1"], "--from-s and --to-s are for --bus: leave them out, and copy the range of time first, by `resonarm cut`"),
        (["--id", "203"], "the argument '--live [<ADDRESS>]' cannot be used with '--id <ID,…>'"),
        (["--json"], "the argument '--live [<ADDRESS>]' cannot be used with '--json'"),
    ],
)
def test_what_is_for_a_bus_is_refused(programs, arguments, why):
    program = replay(programs, *arguments)
    assert program.wait() == 2
    assert why in program.stderr


def test_waiting_is_for_the_live_view(programs):
    program = programs.resonarm("replay", DWELL, "--bus", "vcan0", "--wait")
    assert program.wait() == 2
    assert "the argument '--bus <BUS>' cannot be used with '--wait'" in program.stderr

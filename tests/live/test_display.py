"""How the page shows what it has: on screens of every scale, paused, zoomed, without a connection, with less motion."""

import csv
import io
import signal

import pytest
from live_view import free_run, open_page
from processes import wait_until
from test_page import IN_ORDER, PHONE

# Every canvas as wide as its place, and as many pixels as the screen has there.
FITS = """[...document.querySelectorAll('.plot canvas')].filter((canvas) => canvas.clientHeight > 0).every((canvas) => {
    const [shown, place] = [canvas.getBoundingClientRect(), canvas.closest('.plot').getBoundingClientRect()];
    return Math.abs(shown.width - place.width) < 2 && Math.abs(canvas.width - shown.width * devicePixelRatio) < 2
        && Math.abs(canvas.height - shown.height * devicePixelRatio) < 2;
})"""
SET = "resonarm.ask({ set: { load: 12, frequency_hz: 15, phase_deg: 0 } })"
# The ends of the time axis of a plot.
ENDS = "(({ min, max }) => [min, max])(resonarm.views.bands['acceleration-c'].plot.scales.x)"
NEWEST = "resonarm.data.newest / resonarm.data.about.rate_hz"


# At a scale other than 1 the plots were as large as their bitmaps, and covered each other.
@pytest.mark.parametrize(
    ("scale", "screen"), [(1, {}), (1.25, {}), (2, {}), (3, PHONE)], ids=["1", "1.25", "2", "phone"]
)
def test_plots_fill_their_panels_on_screens_of_every_scale(browser, programs, tmp_path, scale, screen):
    page = open_page(browser, free_run(programs), scale=scale, **screen)
    page.until("resonarm.data.times.length > 50 && resonarm.data.frames > 10")
    assert page.value("devicePixelRatio") == scale
    page.until(FITS)
    assert page.value("document.documentElement.scrollWidth <= innerWidth"), "it is wider than the screen"
    assert page.value(IN_ORDER)
    page.picture(tmp_path / "scale.png")
    assert page.errors == []


def test_a_lost_connection_is_not_shown_as_armed(browser, programs):
    run = free_run(programs)
    page = open_page(browser, run)
    page.until("document.getElementById('state').textContent === 'armed'")
    assert page.value("document.getElementById('lost').hidden && !document.body.classList.contains('stale')")
    # A program that is stopped closes no connection.
    run.process.send_signal(signal.SIGSTOP)
    page.until("document.getElementById('state').textContent === 'was armed'")
    assert page.text("#lost").startswith("No data come from the program: everything below is as it was at ")
    run.process.send_signal(signal.SIGCONT)
    page.until("document.getElementById('state').textContent === 'armed' && document.getElementById('lost').hidden")
    run.kill()
    page.until("document.getElementById('state').textContent === 'was armed'")
    assert page.text("#lost").startswith("The connection to the program is lost: everything below is as it was at ")
    red, grey = page.value("""[getComputedStyle(document.getElementById('lost')).backgroundColor,
        Number(getComputedStyle(document.querySelector('main')).opacity)]""")
    assert red == "rgb(179, 38, 30)" and grey < 0.6
    assert page.value("document.getElementById('state').className") == "past"


def test_the_display_pauses_zooms_and_moves_while_the_run_goes_on(browser, programs):
    page = open_page(browser, free_run(programs))
    page.value(SET)
    page.until(f"{NEWEST} > 4 && resonarm.data.times.length > 300")
    page.value("document.getElementById('hold').click()")
    page.until("resonarm.paused !== null && document.getElementById('hold').textContent === 'Resume display'")
    # Until the plots are drawn again they have the ends of the frame before.
    page.until(f"Math.abs({ENDS}[1] - resonarm.timeWindow.fixed[1]) < 1e-9")
    from_s, to_s = page.value(ENDS)
    newest_s = page.value(NEWEST)
    page.until(f"{NEWEST} > {newest_s} + 0.5")
    assert page.value(ENDS) == [from_s, to_s]
    page.value("document.querySelector('[data-zoom=\"0.5\"]').click()")
    page.until(f"Math.abs({ENDS}[1] - {ENDS}[0] - {(to_s - from_s) / 2}) < 1e-6")
    middle_s = (from_s + to_s) / 2
    assert sum(page.value(ENDS)) / 2 == pytest.approx(middle_s)
    page.value("document.querySelector('[data-move=\"-0.5\"]').click()")
    page.until(f"Math.abs(({ENDS}[0] + {ENDS}[1]) / 2 - {middle_s - (to_s - from_s) / 4}) < 1e-6")
    # By mouse: a drag zooms, one with Shift moves, and two clicks return to the run.
    box = page.value("""(() => {
        const over = document.querySelector('#acceleration-c .u-over');
        over.scrollIntoView({ block: 'center' });
        const { left, top, width, height } = over.getBoundingClientRect();
        return [left, top + height / 2, width];
    })()""")
    at = lambda share: (box[0] + share * box[2], box[1])
    low, high = page.value(ENDS)
    page.drag(at(0.25), at(0.75))
    page.until(f"Math.abs({ENDS}[1] - {ENDS}[0] - {(high - low) / 2}) < {0.02 * (high - low)}")
    low, high = page.value(ENDS)
    page.drag(at(0.5), at(0.75), shift=True)
    page.until(f"Math.abs({ENDS}[0] - {low - 0.25 * (high - low)}) < {0.02 * (high - low)}")
    # All plots over time show the same stretch, and the cursor has its values in the legends.
    assert page.value("""new Set(Object.values(resonarm.views.bands).map((band) => band.x.join())).size""") == 1
    page.point(*at(0.5))
    page.until("/^at [0-9.]+ s$/.test(document.querySelector('#acceleration-b .legend > .value').textContent)")
    page.until("document.querySelector('#acceleration-c .legend .value').textContent !== ''")
    page.value("""document.querySelector('#acceleration-c .u-over').dispatchEvent(new MouseEvent('dblclick'))""")
    page.until(f"resonarm.paused === null && {ENDS}[1] > {newest_s} + 0.5")
    assert page.errors == []


def test_what_is_shown_is_saved_as_numbers_and_as_a_picture(browser, programs):
    page = open_page(browser, free_run(programs))
    page.value(SET)
    page.until(f"{NEWEST} > 3")
    rows = lambda: list(csv.DictReader(io.StringIO(page.value("resonarm.exported()"))))
    enveloped = rows()
    assert {"time_s", "force_x_n_least", "force_x_n_largest", "acceleration_c_x_m_s2_largest"} <= set(enveloped[0])
    page.value("(document.getElementById('span').value = '0.5', "
               "document.getElementById('span').dispatchEvent(new Event('change')))")  # fmt: skip
    wait_until(lambda: "acceleration_c_x_m_s2" in rows()[0], "samples one by one")
    times = [float(row["time_s"]) for row in rows()]
    assert len(times) == pytest.approx(500, abs=3) and times[1] - times[0] == pytest.approx(1e-3)
    # Files come by links to data in the page.
    page.value("""(() => {
        window.saved = [];
        const make = URL.createObjectURL;
        let made = null;
        URL.createObjectURL = (blob) => make.call(URL, made = blob);
        HTMLAnchorElement.prototype.click = function () { saved.push([this.download, made.type, made.size]); };
        document.getElementById('save-csv').click();
        document.getElementById('save-picture').click();
    })()""")
    page.until("saved.length === 2")
    for name, kind, size in page.value("saved"):
        assert (name[-4:], kind) in ((".csv", "text/csv"), (".png", "image/png")) and size > 5000, (name, kind, size)


def test_more_than_eight_seconds_are_kept(browser, programs):
    page = open_page(browser, free_run(programs))
    page.value("(document.getElementById('span').value = '30', "
               "document.getElementById('span').dispatchEvent(new Event('change')))")  # fmt: skip
    page.until(f"{NEWEST} > 10")
    page.until(f"{ENDS}[1] - {ENDS}[0] > 9.5 && resonarm.data.times[0] < 0.5")


def test_the_envelope_of_a_steady_sine_is_steady(browser, programs):
    """Stretches of 10 ms see a part of a period each: their edges formed patterns that the vibration does not have."""
    page = open_page(browser, free_run(programs))
    page.value(SET)
    page.until("resonarm.data.spectrum && Math.abs(resonarm.data.spectrum.peak_hz - 15) < 0.1")
    page.until("Math.max(...resonarm.data.largest[2].slice(-300)) > 11.9 && resonarm.data.times.length > 700")
    # From the last seconds, in which the load is steady.
    ripple = """(() => {
        const { times, largest } = resonarm.views.bands.load.drawn;
        const last = largest[0].filter((_, k) => times[k] > times[times.length - 1] - 2.5);
        return [last.length, Math.min(...last) / Math.max(...last)];
    })()"""
    wait_until(lambda: (found := page.value(ripple))[0] > 50 and found[1] > 0.97, "a steady envelope")


def test_with_less_motion_the_structure_stands_still(browser, programs):
    page = open_page(browser, free_run(programs), still=True)
    page.value(SET)
    page.until("resonarm.data.spectrum && Math.abs(resonarm.data.spectrum.peak_hz - 15) < 0.1")
    page.until("resonarm.views.structure.factor > 1 && Math.max(...resonarm.data.largest[2].slice(-100)) > 11.9")
    page.value("window.tips = new Set(), window.drawn = resonarm.data.frames")
    page.until("tips.add(resonarm.views.structure.tip.map(Math.round).join()) && resonarm.data.frames > drawn + 4")
    # The largest vibration of a period: always on the same side, where noise moves it by some pixels.
    tips = [[int(number) for number in tip.split(",")] for tip in page.value("[...tips]")]
    assert all(max(along) - min(along) <= 6 for along in zip(*tips, strict=True)), tips
    assert page.errors == []


def test_what_is_scrolled_to_after_the_run_is_drawn(browser, programs):
    run = free_run(programs, "--json")
    page = open_page(browser, run, height=650)
    page.until("document.getElementById('state').textContent === 'armed'")
    page.value("document.querySelector('[data-request=disarm]').click()")
    run.result()
    page.until("document.getElementById('link').textContent === 'the run is over'")
    page.value("window.before = -1")
    page.until("(window.before === resonarm.data.frames) || (window.before = resonarm.data.frames, false)")
    page.value("window.scrollTo(0, document.body.scrollHeight)")
    page.until("resonarm.data.frames > window.before")
    assert page.errors == []


def test_titles_agree_with_their_boxes_and_curves_have_names(browser, programs):
    page = open_page(browser, free_run(programs))
    scale = "document.getElementById('structure-scale').textContent"
    assert not page.value("document.getElementById('to-scale').checked")
    page.until(f"{scale}.startsWith('vibration ×')")
    page.value("document.getElementById('to-scale').click()")
    page.until(f"{scale} === 'to scale'")
    names = page.value("""[...document.querySelectorAll('#acceleration-c button')].map((it) => it.ariaLabel)""")
    assert names == ["x: acceleration_c_x_m_s2", "y: acceleration_c_y_m_s2"]
    label = page.value("document.querySelector('#acceleration-c canvas').ariaLabel")
    assert label == "Acceleration of C: acceleration_c_x_m_s2, acceleration_c_y_m_s2"
    assert "the plant is armed (operational)" in page.text("#events")


def test_the_demo_is_shown_until_it_is_stopped_and_clips_nothing(browser, programs, tmp_path):
    """The page vanished at the end of the demo; its first picture had clipped readings in three panels."""
    demo = programs.resonarm("demo", "--speed", 0, "--live", "--out", tmp_path)
    page = open_page(browser, demo)
    page.until("document.getElementById('link').textContent === 'the run is over'")
    page.until("resonarm.data.points.length === 20")
    assert page.value("resonarm.data.points.every((point) => !point.clipped.includes(true))")
    assert page.text("#state") == "was ready" and demo.running()
    wait_until(lambda: "shown until Ctrl-C" in demo.stderr, "the note")
    demo.process.send_signal(signal.SIGINT)
    assert demo.wait() == 0
    assert (tmp_path / "response.svg").exists()

"""Requests and keys of the page."""

import re

from live_view import Viewer, address, free_run, open_page

ANSWER = "document.getElementById('answer').textContent"
NOW = "document.getElementById('set-point-now').textContent"
# Everything in the controls that can be pressed, dragged or written in.
ENABLED = """[...document.querySelectorAll('#controls button, #controls input, #controls select')]
    .filter((it) => !it.closest('[hidden]') && !it.matches(':disabled')).length"""


def write(page, **fields):
    """Writes into the form of the set-point, and sees whether the page takes it."""
    for name, value in fields.items():
        field = f"document.getElementById('set-{name}')"
        page.value(f"{field}.value = '{value!r}', {field}.dispatchEvent(new Event('input', {{ bubbles: true }}))")
    return page.value("document.getElementById('set-point').checkValidity()")


def press_set(page):
    page.value("document.querySelector('#set-point button').click()")


def test_the_set_point_is_shown_to_everybody_and_confirmed(browser, programs):
    run = free_run(programs)
    url, token = address(run)
    page, looker = open_page(browser, run), browser.page(url)
    at_first = page.until(f"{NOW}.match(/^set: 0 N at (17[.]7[0-9]*) Hz, 0°$/)?.[1]")
    fields = "[...document.querySelectorAll('#set-point input')].map((it) => it.value)"
    assert page.value(fields) == ["0", at_first, "0"]
    looker.until("window.resonarm?.data?.frames > 3")
    looker.until(f"{NOW} === 'set: 0 N at {at_first} Hz, 0°'")
    assert write(page, load=12.5, frequency=15, phase=-30)
    # The request is shown until the exciter has it.
    page.value(f"window.answers = []; new MutationObserver(() => answers.push({ANSWER}))"
               ".observe(document.getElementById('answer'), { childList: true })")  # fmt: skip
    press_set(page)
    for each in (page, looker):
        each.until(f"{NOW} === 'set: 12.5 N at 15 Hz, -30°'")
    page.until(f"{ANSWER} === ''")
    assert "requested: 12.5 N at 15 Hz, -30°" in page.value("answers")
    # A later viewer gets it, and one that has not edited its form sees the set-point of another.
    assert Viewer(url).next("set-point") == {"kind": "set-point", "load": 12.5, "frequency_hz": 15, "phase_deg": -30}
    viewer = Viewer(url, token)
    assert viewer.ask({"set": {"load": 3, "frequency_hz": 16, "phase_deg": 0}}) == {"kind": "taken"}
    page.until(f"{NOW} === 'set: 3 N at 16 Hz, 0°' && {fields}.join() === '3,16,0'")
    assert page.errors == looker.errors == []


def test_the_page_and_the_program_have_the_same_limits(browser, programs):
    page = open_page(browser, free_run(programs))
    page.until(f"{NOW}.startsWith('set: 0 N')")
    # The highest frequency is 0.4995 of the sample rate.
    for name, least, most in (("load", 0, 100), ("frequency", 0.01, 499.5), ("phase", -360, 360)):
        for end in (least, most):
            assert write(page, load=1, frequency=15, phase=0) and write(page, **{name: end})
            press_set(page)
            page.until(f"{ANSWER} === '' && {NOW}.includes('{end:g}')")
        # So little that a page which rounds before it compares would let it pass.
        step = (most - least) * 1e-6
        for beyond in (least - step, most + step):
            assert not write(page, **{name: beyond})
            page.value(f"""(() => {{
                const [load, frequency_hz, phase_deg] = ['load', 'frequency', 'phase'].map((name) =>
                    document.getElementById(`set-${{name}}`).valueAsNumber);
                resonarm.ask({{ set: {{ load, frequency_hz, phase_deg }} }});
            }})()""")
            page.until(f"{ANSWER}.startsWith('the {name} is ')")
    assert page.errors == []


def test_a_refusal_vanishes_when_its_cause_is_corrected(browser, programs):
    run = free_run(programs)
    url, token = address(run)
    page = open_page(browser, run)
    page.value("resonarm.ask({ set: { load: 1e6, frequency_hz: 15, phase_deg: 0 } })")
    page.until(f"{ANSWER}.startsWith('the load is 1000000 N: it must be from 0 to')")
    assert not write(page, load=1e6)
    assert page.text("#answer") != ""
    assert write(page, load=12.0)
    assert page.text("#answer") == ""
    # Of a token that is missing or wrong the cause is in the address.
    looker = browser.page(url)
    looker.until("window.resonarm?.data?.frames > 3")
    looker.until(f"{ANSWER}.startsWith('To steer, open the whole address') && {ENABLED} === 0")
    looker.value("location.hash = '0123'")
    looker.until(f"{ANSWER} === '' && {ENABLED} > 0")
    looker.value("document.querySelector('[data-request=disarm]').click()")
    looker.until(f"{ANSWER}.startsWith('the token is wrong')")
    looker.value(f"location.hash = '{token}'")
    looker.until(f"{ANSWER} === ''")
    looker.value("document.querySelector('[data-request=disarm]').click()")
    assert run.wait() == 0
    assert page.errors == looker.errors == []


def test_nothing_can_be_asked_for_after_the_end_or_without_a_connection(browser, programs):
    run = free_run(programs)
    page = open_page(browser, run)
    page.until(f"{ENABLED} === 5")
    page.value("document.querySelector('[data-request=disarm]').click()")
    assert run.wait() == 0
    page.until("document.getElementById('link').textContent === 'the run is over'")
    assert page.value(ENABLED) == 0 and page.text("#answer") == ""
    # Of one that is over without a word: it may come back.
    run = free_run(programs)
    page = open_page(browser, run)
    run.kill()
    page.until("document.getElementById('link').textContent === 'not connected'")
    assert page.value(ENABLED) == 0


def test_the_head_says_what_its_numbers_are(browser, programs):
    page = open_page(browser, free_run(programs))
    words = page.value("[...document.querySelectorAll('header p')].map((it) => it.innerText.trim())")
    assert [word for word in words if re.fullmatch(r"Time \d+\.\d\d s", word)] and words[-1] == "connected", words


# How many pixels of a canvas have nearly a colour of the page.
PIXELS_OF = """((selector, name) => {
    const canvas = document.querySelector(selector);
    const copy = new OffscreenCanvas(canvas.width, canvas.height).getContext('2d', { willReadFrequently: true });
    const rgb = (draw) => { draw(); return copy.getImageData(0, 0, canvas.width, canvas.height).data; };
    const hue = getComputedStyle(document.documentElement).getPropertyValue(`--${name}`);
    const [r, g, b] = rgb(() => { copy.fillStyle = hue; copy.fillRect(0, 0, 1, 1); });
    copy.clearRect(0, 0, 1, 1);
    const pixels = rgb(() => copy.drawImage(canvas, 0, 0));
    const near = (k) => pixels[k + 3] > 150 && Math.hypot(pixels[k] - r, pixels[k + 1] - g, pixels[k + 2] - b) < 30;
    let count = 0;
    for (let k = 0; k < pixels.length; k += 4) count += near(k);
    return count;
})"""


def test_the_load_is_seen_beside_a_head_that_reads_the_same(browser, programs):
    page = open_page(browser, free_run(programs))
    page.value("resonarm.ask({ set: { load: 12, frequency_hz: 15, phase_deg: 0 } })")
    page.until("Math.max(...resonarm.data.largest[4].slice(-200)) > 11.9 && resonarm.data.times.length > 150")
    for panel in ("load", "force"):
        assert page.value(f"{PIXELS_OF}('#{panel} canvas', 'first')") > 60, panel
    assert page.errors == []


def test_series_are_shown_and_hidden_by_keys(browser, programs):
    page = open_page(browser, free_run(programs))
    page.value("resonarm.ask({ set: { load: 12, frequency_hz: 15, phase_deg: 0 } })")
    page.until("Math.max(...resonarm.data.largest[8].slice(-20)) > 0.5")
    page.value("document.querySelector('#acceleration-c button').focus()")
    pressed = "document.querySelector('#acceleration-c button').getAttribute('aria-pressed')"
    blue = f"{PIXELS_OF}('#acceleration-c canvas', 'first')"
    assert page.value(pressed) == "true" and page.value(blue) > 100
    page.press(" ")
    assert page.value(pressed) == "false"
    page.until(f"{blue} === 0")
    page.press("Enter")
    page.until(f"{pressed} === 'true' && {blue} > 100")
    names = "[...document.querySelectorAll('.plot button')].map((it) => it.textContent).join()"
    assert page.value(names) == (
        "load x,load y,head x,head y,x,y,x,y,force x (N),force y (N),C x (m/s²),C y (m/s²),α₁,α₂,load,largest,lateness,latest"
    )
    assert page.errors == []


# The texts along the frequency axis of the responses.
LABELS = """(() => {
    const texts = [], write = CanvasRenderingContext2D.prototype.fillText;
    CanvasRenderingContext2D.prototype.fillText = function (text, x, y) {
        if (this.canvas.id === 'response') texts.push([text, x, y]);
        return write.call(this, text, x, y);
    };
    const { branch, points } = resonarm.data;
    resonarm.views.response.draw(branch, points, 0, 0);
    CanvasRenderingContext2D.prototype.fillText = write;
    const along = Math.max(...texts.filter(([text]) => /^[\\d.]+$/.test(text)).map(([, , y]) => y));
    return texts.filter(([, , y]) => y === along).map(([text]) => Number(text));
})()"""


def test_a_single_frequency_has_an_axis_and_every_mark_a_key(browser, programs):
    page = open_page(browser, free_run(programs))
    page.value("resonarm.ask({ set: { load: 12, frequency_hz: 15, phase_deg: 0 } })")
    page.until("resonarm.data.points.length === 1")
    labels = page.value(LABELS)
    assert 2 <= len(labels) == len(set(labels)) <= 10
    assert min(labels) < 15 < max(labels) and 0.3 < max(labels) - min(labels) < 3
    assert page.value("[...document.querySelectorAll('#response-key > span')].map((it) => it.innerText.trim())") == [
        "stable", "unstable", "fold", "read, settled", "read, not settled", "the latest", "× from clipped readings",
        "strongest vibration",
    ]  # fmt: skip
    dot = "getComputedStyle(document.querySelector('#response-key {}')).backgroundColor"
    clear, filled = page.value(dot.format(".dot.open")), page.value(dot.format("[class=dot]"))
    assert clear == "rgba(0, 0, 0, 0)" and filled == "rgb(0, 128, 106)"
    assert page.errors == []

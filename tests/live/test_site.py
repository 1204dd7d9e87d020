"""The site of the documents in Chromium: what its pages load, say and show, with scripts and without."""

import functools
import http.server
import threading
from pathlib import Path

import pytest

SITE = Path("target/site")
PAGES = ["index.html", "docs/gallery.html", "scenarios/index.html"]
PAGES += [f"docs/tutorials/{name}.html" for name in ("controller", "recording", "folds")]
PAGES += [f"docs/reference/{name}.html" for name in ("commands", "keys", "channels", "requirements", "python")]
# Relative luminance and contrast of WCAG 2.2, success criterion 1.4.3: 4.5 for text.
CONTRASTS = """(() => {
    const light = (colour) => {
        const [r, g, b] = colour.match(/[0-9.]+/g).map((c) => c / 255)
            .map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4));
        return 0.2126 * r + 0.7152 * g + 0.0722 * b;
    };
    const behind = (element) => {
        for (let e = element; e; e = e.parentElement) {
            const colour = getComputedStyle(e).backgroundColor;
            if (!/, 0\\)$|^transparent$/.test(colour)) return colour;
        }
        return 'rgb(255, 255, 255)';
    };
    const contrast = (e) => {
        const [a, b] = [light(getComputedStyle(e).color), light(behind(e))].sort((x, y) => y - x);
        return (a + 0.05) / (b + 0.05);
    };
    return Math.min(...[...document.querySelectorAll('article p, article li, article td, article a')].map(contrast));
})()"""

# What screen readers and keyboards need of a page: its language, title and scale, names of links, buttons, fields and
# pictures, headings without gaps, identifiers that are used once.
FAULTS = """(() => {
    const faults = [];
    const must = (holds, what, e) => holds || faults.push(`${what}: ${e?.outerHTML.slice(0, 120) ?? document.URL}`);
    const all = (selector) => [...document.querySelectorAll(selector)];
    const shown = (e) => e.checkVisibility() && !e.closest('[aria-hidden=true]');
    const pictures = (e) => [...e.querySelectorAll('img')].map((image) => image.alt);
    const names = (e) => [e.getAttribute('aria-label'), e.title, e.textContent, ...pictures(e)];
    const name = (e) => names(e).some((text) => text?.trim());
    const labelled = (e) => e.labels?.length || e.getAttribute('aria-label') || e.title || e.placeholder;
    const scale = document.querySelector('meta[name=viewport]')?.content ?? '';
    must(document.documentElement.lang, 'no language');
    must(document.title.trim(), 'no title');
    must(/width=device-width/.test(scale) && !/user-scalable=no|maximum-scale/.test(scale), 'no scale');
    must(all('main, [role=main]').length === 1, 'not one main part');
    must(all('article h1').length === 1, 'not one heading of the page');
    all('img').forEach((e) => must(e.alt?.trim(), 'a picture without a text', e));
    all('a[href], button').filter(shown).forEach((e) => must(name(e), 'a link or button without a name', e));
    all('input, select').filter(shown).forEach((e) => must(labelled(e), 'a field without a name', e));
    let last = 0;
    for (const heading of all('article :is(h1, h2, h3, h4, h5, h6)')) {
        const level = Number(heading.tagName[1]);
        must(level <= last + 1, 'a heading that leaves out a level', heading);
        last = level;
    }
    const ids = all('[id]').map((e) => e.id);
    ids.filter((id, k) => ids.indexOf(id) !== k).forEach((id) => must(false, 'used twice: ' + id));
    return faults;
})()"""


@pytest.fixture(scope="module")
def address():
    assert (SITE / "index.html").is_file(), "docs/run makes the site"

    class Silent(http.server.SimpleHTTPRequestHandler):
        def log_message(self, *_):
            pass

    handler = functools.partial(Silent, directory=SITE)
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


@pytest.mark.parametrize("name", PAGES)
def test_pages_load_without_a_message_and_can_be_read(browser, address, name):
    page = browser.page(f"{address}/{name}")
    page.until("document.readyState === 'complete' && document.querySelector('article h1') !== null")
    assert page.value("[...document.images].every((image) => image.complete && image.naturalWidth > 0)")
    assert page.value(CONTRASTS) >= 4.5
    assert page.value(FAULTS) == []
    assert page.errors == []


def test_the_search_finds_by_keyboard_alone(browser, address):
    page = browser.page(f"{address}/index.html")
    page.until("document.readyState === 'complete' && document.querySelector('article h1') !== null")
    page.until("document.querySelector('[data-md-component=search]') !== null")
    page.press("/")
    # It is in a tree of its own.
    page.until("document.activeElement.shadowRoot?.querySelector('input') ?? null")
    page.press(*"Neimark")
    found = "[...document.activeElement.shadowRoot.querySelectorAll('a')]"
    page.until(f"{found}.some((link) => /docs\\/.*html/.test(link.href) && /Neimark/.test(link.textContent))")
    assert page.errors == []


def test_pages_are_whole_without_scripts(browser, address):
    page = browser.page("about:blank")
    page.call("Emulation.setScriptExecutionDisabled", value=True)
    page.call("Page.navigate", url=f"{address}/docs/tutorials/folds.html")
    page.until("document.readyState === 'complete' && document.querySelector('article h1') !== null")
    assert "unstable" in page.text("article")
    page.call("Runtime.evaluate", expression="document.querySelector('nav a[href$=\"controller.html\"]').click()")
    page.until("document.title.includes('controller')")

"""The site of the documents in Chromium: what its pages load, say and show, with scripts and without."""

import functools
import http.server
import threading
from pathlib import Path

import pytest

SITE = Path("target/site")
PAGES = ["index.html", "docs/tutorials/folds.html", "docs/reference/commands.html", "docs/gallery.html"]
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


@pytest.fixture(scope="module")
def address():
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

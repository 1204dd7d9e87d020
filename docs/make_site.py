"""Builds the site: collects the documents, writes the reference from the program, the Python package and the tables
that tests compare with the code, and checks every link of the result. Called by docs/run."""

import html.parser
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from urllib.parse import unquote, urlsplit

import reference

ROOT = Path(__file__).resolve().parents[1]
SOURCE, SITE = ROOT / "target/site-source", ROOT / "target/site"
# Folders whose documents are pages; what these link to in the project comes along.
PAGES = ["*.md", "docs/**/*.md", "scenarios/*.md", "recordings/*.md", "firmware-protocol/**/*.md", "python/*.md"]
PAGES += ["examples/**/*.md", "crates/*/README.md", "fuzz/README.md"]
LINK = re.compile(r"\[(?P<text>[^\]]*)\]\((?P<target>[^)\s]+)[^)]*\)")


def main():
    shutil.rmtree(SOURCE, ignore_errors=True)
    shutil.rmtree(SITE, ignore_errors=True)
    pages = collect()
    reference.write(ROOT, SOURCE / "docs/reference", os.environ["RESONARM_BIN"])
    shutil.copy(ROOT / "docs/zensical.toml", SOURCE.parent / "zensical.toml")
    copy(ROOT / "docs/site.css")
    build = subprocess.run(["zensical", "build", "--strict", "--config-file", SOURCE.parent / "zensical.toml"])
    wrong = broken_links() + fetched_at_view_time()
    print(*wrong, sep="\n")
    made = len(list(SITE.rglob("*.html")))
    print(f"{len(pages)} documents, {made} pages, {len(wrong)} broken links: {SITE}/index.html")
    return 1 if build.returncode or wrong else 0


def collect():
    """Copies the documents, and the files in the project that they link to; links to folders without a page are left
    out."""
    pages = [path for pattern in PAGES for path in ROOT.glob(pattern) if "target" not in path.parts]
    for page in pages:
        to = SOURCE / page.relative_to(ROOT)
        to.parent.mkdir(parents=True, exist_ok=True)
        to.write_text(LINK.sub(lambda link, page=page: on_site(page, link), page.read_text()))
    return pages


def on_site(page, link):
    """A link, or its text alone."""
    parts = urlsplit(link["target"])
    path = (page.parent / unquote(parts.path)).resolve()
    if parts.scheme or not parts.path:
        return link[0]
    if path.is_file() and path.suffix != ".md":
        copy(path)
    if path.is_dir():
        has_page = (path / "README.md").exists()
        return f"[{link['text']}]({parts.path.rstrip('/')}/README.md)" if has_page else link["text"]
    return link[0]


def copy(path):
    to = SOURCE / path.relative_to(ROOT)
    to.parent.mkdir(parents=True, exist_ok=True)
    shutil.copy(path, to)


class Page(html.parser.HTMLParser):
    """The targets, the anchors and what is loaded of a page."""

    def __init__(self, text):
        super().__init__()
        self.targets, self.anchors, self.loaded = [], set(), []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        values = dict(attributes)
        self.anchors |= {values[key] for key in ("id", "name") if values.get(key)}
        target = values.get("href") if tag in ("a", "link") else values.get("src")
        if target:
            self.targets.append(target)
            if tag in ("script", "img", "iframe") or (tag == "link" and values.get("rel") == "stylesheet"):
                self.loaded.append(target)


def broken_links():
    pages = {path.resolve(): Page(path.read_text()) for path in SITE.rglob("*.html")}
    wrong = []
    for path, page in pages.items():
        for target in set(page.targets):
            parts = urlsplit(target)
            if parts.scheme or parts.netloc or path.name == "404.html":
                continue
            to = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            to = to / "index.html" if to.is_dir() else to
            if not to.exists():
                wrong.append(f"{path.relative_to(SITE)}: {target} is not there")
            elif parts.fragment and to in pages and unquote(parts.fragment) not in pages[to].anchors:
                wrong.append(f"{path.relative_to(SITE)}: {target} has no such heading")
    return sorted(wrong)


def fetched_at_view_time():
    """What a page would load from elsewhere."""
    pages = {path: Page(path.read_text()).loaded for path in SITE.rglob("*.html")}
    return [f"{path.name} loads {one}" for path, loaded in pages.items() for one in loaded if urlsplit(one).netloc]


if __name__ == "__main__":
    sys.exit(main())

"""Builds the site: collects the documents, writes the reference from the program and the Python package, and checks
every link of the result. Called by docs/run."""

import ast
import html.parser
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from urllib.parse import unquote, urlsplit

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
    reference = SOURCE / "docs/reference"
    reference.mkdir(parents=True)
    (reference / "commands.md").write_text(commands(os.environ["RESONARM_BIN"]))
    (reference / "python.md").write_text(python_package())
    shutil.copy(ROOT / "docs/zensical.toml", SOURCE.parent / "zensical.toml")
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


def help_of(program, *words):
    environment = os.environ | {"COLUMNS": "80"}
    done = subprocess.run([program, *words, "--help"], capture_output=True, text=True, check=True, env=environment)
    return done.stdout


def listed(text):
    """The names in the lists of commands of a help."""
    before = text.split("\nOptions:")[0].split("Usage:")[1]
    lines = [line for line in before.splitlines()[1:] if line.startswith("  ") and not line.startswith("   ")]
    return [line.split()[0] for line in lines if line.split()[0] != "help"]


def commands(program):
    """The help of every command."""
    parts = ["# Commands\n\nAs `--help` prints them.\n"]

    def add(*words):
        text = help_of(program, *words)
        parts.append(f"## resonarm {' '.join(words)}".rstrip() + f"\n\n```text\n{text.rstrip()}\n```\n")
        for name in listed(text) if not words or "<COMMAND>" in text else []:
            add(*words, name)

    add()
    return "\n".join(parts)


def python_package():
    """What the Python package exports, with signatures and documentation strings."""
    folder = ROOT / "python/resonarm"
    exported = [name for name in literal(folder / "__init__.py", "__all__") if not name.startswith("_")]
    definitions = {}
    for path in [*sorted(folder.glob("*.py")), folder / "_resonarm.pyi"]:
        for node in ast.parse(path.read_text()).body:
            if isinstance(node, (ast.ClassDef, ast.FunctionDef)):
                definitions.setdefault(node.name, node)
    parts = ["# The Python package\n\nWhat `import resonarm` offers; [its guide](../python.md) shows how it is used.\n"]
    for name in exported:
        if name in definitions:
            parts += described(definitions[name], "##", "resonarm")
    return "\n".join(parts)


def literal(path, name):
    """The value of a list of strings at the top of a module."""
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == name:
            return ast.literal_eval(node.value)
    raise SystemExit(f"{path} has no {name}")


def described(node, level, owner):
    """A class with its public methods, or a function."""
    signature = ""
    if isinstance(node, ast.FunctionDef):
        returns = f" → {ast.unparse(node.returns)}" if node.returns else ""
        signature = f"({ast.unparse(node.args)}){returns}"
    text = ast.get_docstring(node) or ""
    parts = [f"{level} {owner}.{node.name}\n"]
    parts += [f"```text\n{node.name}{signature}\n```\n"] if signature else []
    parts += [text.replace("<", "&lt;") + "\n"] if text else []
    if isinstance(node, ast.ClassDef):
        for inner in node.body:
            if isinstance(inner, ast.FunctionDef) and not inner.name.startswith("_") and ast.get_docstring(inner):
                parts += described(inner, level + "#", node.name)
    return parts


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

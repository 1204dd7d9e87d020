"""Writes the licences of everything that the packages of a release contain besides this project's own code.

    third_party_licenses.py --package resonarm-cli --features live --target x86_64-unknown-linux-musl \
        --also "musl libc (MIT)=COPYRIGHT" >THIRD-PARTY-LICENSES.txt

The crates are those of Cargo.lock that the named packages need on the target, for code and for build scripts, so that
every component of the SBOM is among them. Their texts are the licence files in the sources that cargo has downloaded. The
standard library of Rust is described by the file that comes with the compiler, fonts and uPlot by the files beside them.
A crate without any licence text is an error, and so is a component of the CycloneDX document of `--sbom` that the text does
not have. Equal texts are printed once.
"""

import argparse
import html.parser
import json
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LICENSE_FILE = re.compile(r"(licen[cs]e|copying|notice|copyright|unlicense)", re.IGNORECASE)
# What is embedded in the program and is no crate.
EMBEDDED = {
    "DejaVu fonts, in the figures": ROOT / "crates/figures/src/plot/fonts/LICENSE-DejaVu.txt",
    "uPlot, in the live view": ROOT / "crates/live/src/page/uplot/LICENSE-uPlot.txt",
}
# The template of the MIT licence, for crates whose archives lack the file that their manifests name.
MIT = """\
Permission is hereby granted, free of charge, to any person obtaining a copy of this software and associated
documentation files (the "Software"), to deal in the Software without restriction, including without limitation the
rights to use, copy, modify, merge, publish, distribute, sublicense, and/or sell copies of the Software, and to permit
persons to whom the Software is furnished to do so, subject to the following conditions:

The above copyright notice and this permission notice shall be included in all copies or substantial portions of the
Software.

THE SOFTWARE IS PROVIDED "AS IS", WITHOUT WARRANTY OF ANY KIND, EXPRESS OR IMPLIED, INCLUDING BUT NOT LIMITED TO THE
WARRANTIES OF MERCHANTABILITY, FITNESS FOR A PARTICULAR PURPOSE AND NONINFRINGEMENT. IN NO EVENT SHALL THE AUTHORS OR
COPYRIGHT HOLDERS BE LIABLE FOR ANY CLAIM, DAMAGES OR OTHER LIABILITY, WHETHER IN AN ACTION OF CONTRACT, TORT OR
OTHERWISE, ARISING FROM, OUT OF OR IN CONNECTION WITH THE SOFTWARE OR THE USE OR OTHER DEALINGS IN THE SOFTWARE.
"""


class MissingText(Exception):
    """A component has no licence text."""


class PlainText(html.parser.HTMLParser):
    """The text of an HTML page, a line for each line of the page that has any."""

    def __init__(self):
        super().__init__()
        self.parts, self.hidden = [], 0

    def handle_starttag(self, tag, attributes):
        self.hidden += tag in ("style", "script", "title")

    def handle_endtag(self, tag):
        self.hidden -= tag in ("style", "script", "title")

    def handle_data(self, data):
        if not self.hidden:
            self.parts.append(data)


def crates(packages, features, target):
    """The crates that the packages need, without those of this project: the entries of `cargo metadata`, by name."""
    words = ["cargo", "metadata", "--format-version", "1", "--locked", "--manifest-path", ROOT / "Cargo.toml"]
    # Build scripts run on this machine.
    words += ["--filter-platform", target, "--filter-platform", host()]
    if features:
        words += ["--features", features]
    metadata = json.loads(subprocess.run(words, capture_output=True, check=True).stdout)
    described = {package["id"]: package for package in metadata["packages"]}
    nodes = {node["id"]: node["deps"] for node in metadata["resolve"]["nodes"]}
    waiting = [identity for identity, package in described.items() if package["name"] in packages]
    if len(waiting) != len(packages):
        raise MissingText(f"the workspace has not all of the packages {', '.join(packages)}")
    found = set()
    while waiting:
        identity = waiting.pop()
        if identity in found:
            continue
        found.add(identity)
        for dependency in nodes[identity]:
            if any(kind["kind"] != "dev" for kind in dependency["dep_kinds"]):
                waiting.append(dependency["pkg"])
    foreign = [described[identity] for identity in found if described[identity]["source"] is not None]
    return sorted(foreign, key=lambda package: (package["name"], package["version"]))


def host():
    """The platform of this machine, as the compiler names it."""
    said = subprocess.run(["rustc", "-vV"], capture_output=True, check=True, text=True).stdout
    return re.search(r"^host: (\S+)", said, re.MULTILINE)[1]


def texts_of_crate(package):
    """The licence texts of a crate."""
    folder = Path(package["manifest_path"]).parent
    files = [path for path in folder.rglob("*") if path.is_file() and LICENSE_FILE.match(path.name)]
    if package["license_file"]:
        files.append(folder / package["license_file"])
    files = sorted({path for path in files if path.suffix not in (".rs", ".h", ".c", ".py")})
    if files:
        return [path.read_text(errors="replace") for path in files]
    if package["license"] == "MIT":
        authors = ", ".join(package["authors"]) or f"the authors of {package['name']}, {package['repository']}"
        return [f"MIT License\n\nCopyright (c) {authors}\n\n{MIT}"]
    raise MissingText(
        f"the crate {package['name']} {package['version']} ({package['license']}) has no licence file: add its text to {__file__}"
    )


def standard_library():
    """What the compiler's makers state of the standard library, which is linked into every program."""
    sysroot = Path(subprocess.run(["rustc", "--print", "sysroot"], capture_output=True, check=True, text=True).stdout.strip())
    folder = sysroot / "share/doc/rust"
    page = folder / "COPYRIGHT-library.html"
    if not page.exists():
        raise MissingText(f"{page} is missing, which has the licences of Rust's standard library: install Rust by rustup")
    parser = PlainText()
    parser.feed(page.read_text())
    lines = [line.strip() for line in "".join(parser.parts).splitlines()]
    return re.sub(r"\n{3,}", "\n\n", "\n".join(lines))


def components(arguments):
    """Pairs of a component's heading and its licence texts."""
    found = []
    for package in crates(arguments.package, arguments.features, arguments.target):
        heading = f"{package['name']} {package['version']} ({package['license']})"
        found.append((heading, texts_of_crate(package)))
    found.append(("Rust standard library (Apache-2.0 OR MIT)", [standard_library()]))
    for name, path in EMBEDDED.items():
        found.append((name, [path.read_text()]))
    for word in arguments.also:
        name, _, path = word.partition("=")
        found.append((name, [Path(path).read_text(errors="replace")]))
    return found


def check_bill_of_materials(path, found):
    """Raises MissingText if a component of a CycloneDX document, other than this project's crates, is not among those
    found."""
    listed = json.loads(Path(path).read_text())["components"]
    foreign = [component for component in listed if "download_url=file:" not in component.get("purl", "")]
    names = [f"{component['name']} {component['version']}" for component in foreign]
    if missing := [name for name in names if not any(heading.startswith(f"{name} (") for heading, _ in found)]:
        raise MissingText(f"{path} lists components whose licences are not in the packages: {', '.join(missing)}")


def document(found):
    """The whole text: the components, then each text with the components that it is of."""
    owners = {}
    for heading, texts in found:
        for text in texts:
            key = " ".join(text.split())
            headings, _ = owners.setdefault(key, ([], text.strip("\n")))
            if heading not in headings:
                headings.append(heading)
    rule = "=" * 78
    parts = [
        "Resonarm is under the Apache License 2.0 or the MIT License, at your option.\n\n"
        "This file has the licences of the software of others that the package contains.\n\n"
        + "\n".join(f"    {heading}" for heading, _ in found)
    ]
    for headings, text in owners.values():
        parts.append(f"{rule}\n" + "\n".join(headings) + f"\n{'-' * 78}\n\n{text}")
    return "\n\n".join(parts) + "\n"


def main():
    parser = argparse.ArgumentParser(description="Writes the licences of third parties to standard output.")
    parser.add_argument("--package", action="append", required=True, help="a package of the workspace; may be repeated")
    parser.add_argument("--features", default="", help="features of the packages, with commas between them")
    parser.add_argument("--target", required=True, help="the platform, as x86_64-unknown-linux-musl")
    parser.add_argument("--also", action="append", default=[], metavar="NAME=FILE", help="a further component and its text")
    parser.add_argument("--sbom", metavar="FILE", help="a CycloneDX document whose components must all be in the text")
    arguments = parser.parse_args()
    try:
        found = components(arguments)
        if arguments.sbom:
            check_bill_of_materials(arguments.sbom, found)
        sys.stdout.write(document(found))
    except MissingText as error:
        sys.exit(f"error: {error}")
    except subprocess.CalledProcessError as error:
        sys.exit(f"error: {error}\n{error.stderr.decode(errors='replace')}")


if __name__ == "__main__":
    main()

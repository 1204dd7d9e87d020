"""What the packages of release/run must contain, and what they and the tests are built with."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = ROOT / "release/third_party_licenses.py"
TARGETS = {
    "x86_64-unknown-linux-musl": ["resonarm-cli", "resonarm-fmu"],
    "x86_64-unknown-linux-gnu": ["resonarm-python"],
}


def script(*words):
    return subprocess.run([sys.executable, SCRIPT, *words], capture_output=True, text=True, cwd=ROOT, timeout=120)


def words_for(target):
    packages = [word for package in TARGETS[target] for word in ("--package", package)]
    return [*packages, "--features", "live", "--target", target]


@pytest.fixture(scope="module", params=TARGETS)
def licenses(request):
    """The target and the text that the packages for it contain."""
    done = script(*words_for(request.param))
    assert done.returncode == 0, done.stderr
    return request.param, done.stdout


def tracked(*patterns):
    """The project's files, by their names."""
    done = subprocess.run(["git", "ls-files", *patterns], capture_output=True, text=True, cwd=ROOT, check=True)
    return [ROOT / name for name in done.stdout.split()]


def test_every_crate_that_is_linked_has_its_licence_in_the_packages(licenses):
    """By cargo's own list. The packages had the project's licences alone, though BSD and MIT demand theirs with copies."""
    target, text = licenses
    packages = [word for package in TARGETS[target] for word in ("-p", package)]
    words = ["cargo", "tree", "--locked", "--prefix", "none", "--edges", "normal,build", "--target", target]
    features = ["--features", "resonarm-cli/live"] if "resonarm-cli" in TARGETS[target] else []
    tree = subprocess.run([*words, *packages, *features], capture_output=True, text=True, cwd=ROOT, check=True).stdout
    linked = {tuple(line.split()[:2]) for line in tree.splitlines() if line and f"({ROOT}" not in line}
    assert len(linked) > 50
    headings = {line for line in text.splitlines() if line.endswith(")")}
    missing = [crate for crate in linked if not any(h.startswith(f"{crate[0]} {crate[1][1:]} (") for h in headings)]
    assert not missing


def test_texts_that_must_come_with_copies_are_whole(licenses):
    _, text = licenses
    for path in ("crates/figures/src/plot/fonts/LICENSE-DejaVu.txt", "crates/live/src/page/uplot/LICENSE-uPlot.txt"):
        assert (ROOT / path).read_text().strip("\n") in text
    assert "Redistributions in binary form must reproduce the above copyright notice" in " ".join(text.split())
    assert "Copyright notices for The Rust Standard Library" in text
    # The manifest of this crate names a licence, and its archive has no text of it.
    assert re.search(r"^Copyright \(c\) jam1garner", text, re.M) or "\nbinrw " not in text


def test_a_component_of_the_bill_of_materials_without_a_licence_is_an_error(tmp_path):
    components = [
        {"name": "zstd-sys", "version": version(r"zstd-sys"), "purl": "pkg:cargo/zstd-sys"},
        {"name": "resonarm-files", "version": "0.1.0", "purl": "pkg:cargo/a@0.1.0?download_url=file://crates/files"},
    ]
    bill = tmp_path / "sbom.json"
    bill.write_text(json.dumps({"components": components}))
    words = [*words_for("x86_64-unknown-linux-musl"), "--sbom", bill]
    assert script(*words).returncode == 0
    bill.write_text(json.dumps({"components": [*components, {"name": "left-pad", "version": "1.3.0"}]}))
    done = script(*words)
    assert done.returncode == 1 and done.stdout == ""
    assert done.stderr == f"error: {bill} lists components whose licences are not in the packages: left-pad 1.3.0\n"


def version(crate):
    lock = (ROOT / "Cargo.lock").read_text()
    return re.search(rf'name = "{crate}"\nversion = "([^"]+)"', lock)[1]


def test_tar_deb_and_wheel_take_them():
    run = (ROOT / "release/run").read_text()
    functions = {name: body for name, body in re.findall(r"^(\w+)\(\) \{\n(.*?)^\}", run, re.M | re.S)}
    assert "/$name/THIRD-PARTY-LICENSES.txt" in functions["make_tar"]
    assert "$stage/copyright" in functions["make_deb"]
    assert '"target/release-stage/copyright", "usr/share/doc/resonarm/copyright"' in (ROOT / "Cargo.toml").read_text()
    assert "add_third_party_licenses" in functions["wheel_of"]


def test_every_crate_uses_its_dependencies():
    """A dependency that nothing uses shows an arrow that the code does not have. Eleven manifests had 34 of them."""
    unused = []
    for manifest in tracked("Cargo.toml", "crates/*/Cargo.toml", "firmware-protocol/Cargo.toml"):
        crate = manifest.parent.relative_to(ROOT)
        files = tracked(*(str(crate / name) for name in ("src", "tests", "benches", "examples", "build.rs")))
        sources = "\n".join(path.read_text() for path in files if path.suffix == ".rs")
        sections = re.findall(r"(?ms)^\[(?!workspace)[\w.()\"'= -]*\bdependencies\]\n(.*?)(?=^\[|\Z)", manifest.read_text())
        assert sections
        for name in re.findall(r"(?m)^([\w-]+)[. ]", "".join(sections)):
            if not re.search(rf"\b{name.replace('-', '_')}\b", sources):
                unused.append((str(crate), name))
    assert not unused


def test_requirements_have_checksums():
    """pip compares what it downloads with them."""
    files = tracked("*requirements*.txt")
    assert len(files) == len(tracked("*requirements.in")) > 3
    for path in files:
        entries = [line for line in path.read_text().replace("\\\n", " ").splitlines() if not line.startswith("#")]
        without = [entry for entry in entries if not re.search(r"==\S+ .*--hash=sha256:[0-9a-f]{64}", entry)]
        assert entries and not without, (path, without)
    callers = [path for path in tracked("*run", "*compare") if re.search(r"(?m)pip\" install", path.read_text())]
    for path in callers:
        for call in re.findall(r'pip" install (?:.*\\\n)*.*', path.read_text()):
            if "requirements.txt" in call:
                assert "--require-hashes" in call, (path, call)


@pytest.mark.parametrize("path", tracked("*.github/workflows/*.yml"), ids=lambda path: path.name)
def test_workflows_pin_actions_and_may_only_read(path):
    text = path.read_text()
    actions = re.findall(r"uses: (\S+)", text)
    assert actions and all(re.fullmatch(r"[\w/-]+@[0-9a-f]{40}", action) for action in actions), actions
    assert re.search(r"^permissions:\n  contents: read\n(?! )", text, re.M)


def test_nothing_tells_to_install_resonarm_from_an_index():
    """It is on none: pip said that no matching distribution is found."""
    wrong = re.compile(r"""pip3?\b[^\n`]*\binstall\b[^\n`]*?[\s"'{-]resonarm(\[\w+\])?(?=["'\s`})]|$)""", re.M)
    found = []
    for path in tracked("*.md", "*.sh", "*.py", "*.yml", "*.rs", "*/run"):
        if path != Path(__file__):
            found += [(path.relative_to(ROOT), match[0]) for match in wrong.finditer(path.read_text())]
    assert not found


WRITTEN = re.compile(
    r"(?:--(?:out|plot|record|report|angles|uff|junitxml)[ =]|(?<![>\d])> ?|bus-kwargs record=)([\w.-]+(?:/[\w.-]+)*)"
    r"|resonarm (?:cut|import|recover) \S+ ([\w.-]+)|can\.logconvert \S+ ([\w.-]+)"
)
# A quickstart and the bench for a build server are copied out of the clone.
OWN_FOLDERS = ("examples/quickstart/README.md", "examples/ci-bench/README.md")


def test_documents_write_different_files():
    """A reader who follows several in one clone loses nothing: README and a tutorial both wrote random.mcap."""
    writers = {}
    for path in tracked("*.md"):
        name, folder = str(path.relative_to(ROOT)), ""
        if name in OWN_FOLDERS or name == "CHANGELOG.md":
            continue
        for block in re.findall(r"^```sh.*?\n(.*?)^```", path.read_text(), re.M | re.S):
            for line in block.splitlines():
                if entered := re.search(r"\bcd ([\w-]+)$", line):
                    folder = entered[1] + "/"
                for found in WRITTEN.finditer(line.partition(" #")[0]):
                    written = folder + next(filter(None, found.groups()))
                    if written != "/dev/null":
                        writers.setdefault(written.removesuffix(".json"), set()).add(name)
    shared = {written: sorted(names) for written, names in writers.items() if len(names) > 1}
    assert len(writers) > 40 and not shared

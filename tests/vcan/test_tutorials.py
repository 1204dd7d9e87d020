"""The tutorials, followed to the letter: what stands in their blocks `sh` is typed, in one shell a block, and draws
their pictures."""

import contextlib
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from processes import PATIENCE_S, RESONARM

FOLDER = Path("docs/tutorials").absolute()
BLOCK = re.compile(r"^```sh\n(.*?)^```$", re.MULTILINE | re.DOTALL)
PICTURE = re.compile(r"^!\[[^\]]+\]\((../images/tutorials/.*\.svg)\)$", re.MULTILINE)
# What the text of each says of the output of its commands.
SAID = {
    "controller": ["along x: 1.1", "identical", "1 passed"],
    "recording": ["integrity    complete", "     1           22.16", "     2           48.8"],
    "folds": [
        "fold at 22.147",
        "fold at 22.142",
        "softening",
        "up and down differ from 22.142500 to 22.145000 Hz",
    ],
}


def test_every_tutorial_is_followed():
    assert {path.stem for path in FOLDER.glob("*.md")} == set(SAID)


def shell(words, folder, environment, path):
    """Exit code and output of a command; what it leaves running in the background is ended."""
    with path.open("w") as said:
        process = subprocess.Popen(
            words, stdout=said, stderr=said, cwd=folder, env=environment, start_new_session=True
        )
        try:
            code = process.wait(PATIENCE_S)
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
    return code, path.read_text()


def texts(picture):
    """Titles, axes with their numbers, and legends of a picture."""
    return re.findall(r">([^<]+)</text>", picture.read_text())


@pytest.mark.parametrize("name", SAID)
def test_a_tutorial_does_what_it_says(name, tmp_path):
    programs = tmp_path / "bin"
    programs.mkdir()
    (programs / "resonarm").symlink_to(Path(RESONARM).absolute())
    path = os.pathsep.join([str(programs), str(Path(sys.executable).parent), os.environ["PATH"]])
    environment = os.environ | {"PATH": path, "PYTHONDONTWRITEBYTECODE": "1"}
    folder, output = tmp_path, ""
    text = (FOLDER / f"{name}.md").read_text()
    blocks, pictures = BLOCK.findall(text), PICTURE.findall(text)
    assert len(blocks) >= 4 and pictures
    for block in blocks:
        words = ["bash", "-euo", "pipefail", "-c", f"{block}\npwd > {tmp_path}/folder"]
        code, said = shell(words, folder, environment, tmp_path / "output")
        assert code == 0, f"{block}\n{said}"
        folder, output = Path((tmp_path / "folder").read_text().strip()), output + said
    assert [words for words in SAID[name] if words not in output] == [], output
    for picture in pictures:
        shown, (drawn,) = FOLDER / picture, tmp_path.rglob(Path(picture).name)
        assert texts(drawn) == texts(shown) and len(texts(shown)) > 10, f"{drawn} is not {shown}"

"""Checks that a source distribution has every file that its crates were built from.

built_from.py ARCHIVE DEPS: ARCHIVE is the source distribution, DEPS the folder `deps` of a build, whose files `*.d` name the
sources of each crate, with those that `include_str!` and the like have read. To be run in the project's folder. Exit status: 0
if none is missing, else 1.
"""

import os
import sys
import tarfile
from pathlib import Path


def sources(description: Path) -> list[str]:
    """Files that a library was built from, by a file `*.d` of rustc; none of a program or a test."""
    for line in description.read_text().splitlines():
        target, _, files = line.partition(": ")
        if target.endswith((".rlib", ".rmeta", ".so")):
            # Some are absolute, and some lead through `..`.
            return [os.path.relpath(file) for file in files.split()]
    return []


def main(archive: str, deps: str) -> int:
    with tarfile.open(archive) as sdist:
        packed = {name.partition("/")[2] for name in sdist.getnames()}
    crates = {str(Path(name).parent) for name in packed if name.endswith("/Cargo.toml")}
    checked, missing = set(), set()
    for description in Path(deps).glob("*.d"):
        files = sources(description)
        # The first one is the crate's root, `src/lib.rs`. A file that a build of the past has read may be gone.
        if files and str(Path(files[0]).parent.parent) in crates:
            checked.add(files[0])
            missing |= {file for file in files if file not in packed and Path(file).exists()}
    unbuilt = crates - {str(Path(root).parent.parent) for root in checked}
    for file in sorted(missing):
        print(f"{archive} lacks {file}, which a crate of it was built from")
    for crate in sorted(unbuilt):
        print(f"{deps} has no build of {crate}, so that its files are not known")
    print(f"{len(checked)} crates of {archive}: {len(missing)} files are missing")
    return 1 if missing or unbuilt else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))

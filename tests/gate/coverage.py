"""Builds the protocol's tests with coverage, runs them, and fails if they leave a line or a branch of the gate out.

The gate is all that a frame passes on its way to the arm: form, E2E protection, content, then the command itself.
"""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
CRATE = ROOT / "firmware-protocol"
GATE = ("src/gate.rs", "src/receiver.rs", "src/e2e/mod.rs", "src/e2e/profile11.rs", "src/e2e/profile5.rs")
TESTS = ("--test", "gate", "--test", "vectors")
# Those of tests/run, so that it does not compile the dependencies again.
FEATURES = ("--workspace", "--features", "python-can,resonarm-protocol/embedded-can")
WORK = ROOT / "target/tests/coverage"


def output(*command, **options):
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True, **options).stdout


def tool(name):
    """A tool of the compiler's LLVM: of the toolchain, or of the system with the major version in its name."""
    sysroot = Path(output("rustc", "--print", "sysroot").strip())
    major = re.search(r"LLVM version: (\d+)", output("rustc", "-vV")).group(1)
    own = sorted(sysroot.glob(f"lib/rustlib/*/bin/{name}"))
    return own[0] if own else f"{name}-{major}"


def built():
    """The test programs, instrumented."""
    environment = os.environ | {"RUSTC_WORKSPACE_WRAPPER": str(ROOT / "tests/gate/rustc")}
    command = ("cargo", "test", *FEATURES, *TESTS, "--no-run", "--locked", "--message-format=json")
    lines = output(*command, cwd=ROOT, env=environment).splitlines()
    return [path for path in (json.loads(line).get("executable") for line in lines) if path]


def measured(programs):
    """llvm-cov's report on each file of the gate, and the arguments for a detailed one."""
    WORK.mkdir(parents=True, exist_ok=True)
    for old in WORK.glob("*.profraw"):
        old.unlink()
    for program in programs:
        profile = os.environ | {"LLVM_PROFILE_FILE": str(WORK / "%p.profraw")}
        subprocess.run([program, "--quiet"], check=True, cwd=CRATE, env=profile)
    merged = WORK / "gate.profdata"
    subprocess.run([tool("llvm-profdata"), "merge", "-sparse", *WORK.glob("*.profraw"), "-o", merged], check=True)
    objects = [programs[0], *(f"-object={program}" for program in programs[1:])]
    arguments = [*objects, f"-instr-profile={merged}", *(CRATE / name for name in GATE)]
    files = json.loads(output(tool("llvm-cov"), "export", "-summary-only", *arguments))["data"][0]["files"]
    return {Path(file["filename"]).relative_to(CRATE).as_posix(): file["summary"] for file in files}, arguments


def main():
    summaries, arguments = measured(built())
    assert sorted(summaries) == sorted(GATE), sorted(summaries)
    missed = 0
    for name, summary in summaries.items():
        counts = {what: (summary[what]["covered"], summary[what]["count"]) for what in ("lines", "branches")}
        print(name, *(f"{covered} of {count} {what}" for what, (covered, count) in counts.items()), sep=", ")
        missed += sum(count - covered for covered, count in counts.values())
    if missed:
        print(output(tool("llvm-cov"), "show", "--show-branches=count", *arguments))
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())

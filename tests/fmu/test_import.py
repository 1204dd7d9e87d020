"""FMUs as the structure under test: one that `resonarm fmu` wrote gives the bits of its own native run."""

import json
import os
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

from conftest import SAMPLES, STEPS, free_run
from fmus import same
from processes import RESONARM
from recordings import LOAD, SENSORS

MOVING = {
    "joint1": ("alpha1_rad", "alpha1_dot_rad_s"),
    "joint2": ("alpha2_rad", "alpha2_dot_rad_s"),
    "mode1": ("q1_m_sqrt_kg", "q1_dot_m_sqrt_kg_s"),
    "mode2": ("q2_m_sqrt_kg", "q2_dot_m_sqrt_kg_s"),
}


def section(fmu, axes):
    """The section of an FMU of ours, whose x and y of exciter and accelerometers B and C are these."""
    loads = {"joint1": "torque1_nm", "joint2": "torque2_nm"}
    loads |= {dof: f"force_{axis}_n" for axis, dof in zip("xy", axes["exciter"], strict=False)}
    outputs = {}
    for dof, (displacement, velocity) in MOVING.items():
        if f"state.{displacement}" in fmu.references:
            outputs[dof] = {"displacement": f"state.{displacement}", "velocity": f"state.{velocity}"}
    for point in "bc":
        for axis, dof in zip("xy", axes[point], strict=False):
            outputs[dof] = {"acceleration": f"true.acceleration_{point}_{axis}_m_s2"}
    for axis, dof in zip("xy", axes["exciter"], strict=False):
        outputs.setdefault(dof, {})["force"] = f"true.head_force_{axis}_n"
    lines = ["[structure]", 'kind = "fmu"', f'file = "{fmu.path}"', 'read = "end"', "[structure.inputs]"]
    lines += [f'"{dof}" = "load.{name}"' for dof, name in loads.items() if f"load.{name}" in fmu.references]
    for dof, variables in outputs.items():
        lines += [f'[structure.outputs."{dof}"]', *(f'{key} = "{name}"' for key, name in variables.items())]
    return "\n".join(lines) + "\n"


ARM = {"exciter": ("tip.x", "tip.y"), "b": ("joint2.x", "joint2.y"), "c": ("tip.x", "tip.y")}


def resim(path, *flags):
    words = [RESONARM, "resim", path, *flags, "--json"]
    return subprocess.run([str(word) for word in words], capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def imported(arm, tmp_path_factory):
    """The scenario of the arm with its FMU in the arm's place."""
    folder = tmp_path_factory.mktemp("imported")
    blocks = [[(7 * block) % 13 - 6] * 10 for block in range(SAMPLES // 10)]
    (folder / "steps.csv").write_text("\n".join(str(load) for block in blocks for load in block))
    before, after = STEPS.split("[structure]")[0], STEPS[STEPS.index("[simulation]"):]
    (folder / "imported.toml").write_text(before + section(arm.fmu, ARM) + after)
    return folder / "imported.toml"


def test_our_own_fmu_gives_the_bits_of_the_native_run(arm, imported, tmp_path):
    recorded = free_run(imported, tmp_path / "run.mcap")
    assert same(recorded.states, arm.native.states)
    assert same(recorded.column("/plant/samples", SENSORS), arm.native.column("/plant/samples", SENSORS))
    frames = [[(frame.id, bytes(frame.data)) for frame in run.frames] for run in (recorded, arm.native)]
    assert frames[0] == frames[1]
    for flags in ((), ("--readings",)):
        done = resim(tmp_path / "run.mcap", "--fmu", arm.fmu.path, *flags)
        assert done.returncode == 0 and '"identical":true' in done.stdout, done


def test_modes_with_friction_in_an_fmu_give_the_bits_of_the_native_run(make, structures, tmp_path):
    end = "[simulation]\nduration_s = 0.3\nseed = 2\n"
    scenario = (structures / "friction.toml").read_text() + end
    (tmp_path / "native.toml").write_text(scenario)
    native = free_run(tmp_path / "native.toml", tmp_path / "native.mcap")
    fmu = make(tmp_path / "native.toml", name="friction")
    axes = dict.fromkeys(("exciter", "b", "c"), ("tip.x", "tip.y"))
    (tmp_path / "fmu.toml").write_text(section(fmu, axes) + scenario[scenario.index("[excitation]"):])
    recorded = free_run(tmp_path / "fmu.toml", tmp_path / "fmu.mcap")
    names = [*MOVING["mode1"], *MOVING["mode2"], *LOAD]
    moved = native.column("/plant/steps", names)
    assert same(recorded.column("/plant/steps", names), moved) and abs(moved[:, 2]).max() > 0
    assert same(recorded.samples, native.samples)


FOLLOW = ("continue", "--drive", "tip.x=1", "--from-hz", "1", "--to-hz", "2")
REFUSED = {
    ("modes",): "which an FMU does not provide",
    ("frf",): "which an FMU does not provide",
    FOLLOW: "which an FMU does not provide",
    ("demo",): "which an FMU does not provide",
    ("run", "--bus", "vcan9"): "use the mode free or lockstep",
    ("fmu", "--out", "again.fmu"): "`kind` is fmu: the structure is an FMU already",
}


@pytest.mark.parametrize("words", REFUSED)
def test_what_needs_equations_or_deadlines_refuses_an_fmu_in_words(imported, library, words, tmp_path):
    flags = ["--library", library] if words[0] == "fmu" else []
    command = [RESONARM, *words, "--scenario", imported, *flags]
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False)
    assert done.returncode == 2 and REFUSED[words] in done.stderr, done


def test_an_fmu_of_ours_that_is_read_within_a_hold_is_refused(imported, tmp_path):
    text = imported.read_text().replace('read = "end"', "").replace("steps.csv", str(imported.parent / "steps.csv"))
    (tmp_path / "s.toml").write_text(text)
    command = [RESONARM, "run", "--mode", "free", "--scenario", tmp_path / "s.toml"]
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, check=False)
    assert done.returncode == 2 and "samples its motion itself: take `read = \"end\"`" in done.stderr, done


HOSTILE = {
    "exits when it is loaded": ("constructor", "exit(0);"),
    "ends at once when it is loaded": ("constructor", "_exit(0);"),
    "crashes when it is loaded": ("constructor", "abort();"),
    "exits when it is unloaded": ("destructor", "exit(0);"),
    "ends at once when it is unloaded": ("destructor", "_exit(0);"),
    "closes all files": ("constructor", "for (int file = 3; file < 1000; file++) close(file);"),
}


def hooked(folder, fault=0, hook=None):
    """The command of a free run of the mass of the examples, with a function that the loader calls, and its TMPDIR."""
    make = runpy.run_path("examples/fmu/make.py")["make"]
    library = []
    if hook:
        kind, body = hook
        source = folder / "hook.c"
        head = "#include <stdlib.h>\n#include <unistd.h>\nvoid hook(void);\n"
        source.write_text(f"{head}__attribute__(({kind})) void hook(void) {{ {body} }}\n")
        library = [str(source)]
    make(folder / "mass.fmu", 3, library)
    text = (Path("examples/fmu") / "mass.toml").read_text().replace("cubic = 2e7", f"fault = {fault}\nfault_s = 0.02")
    (folder / "mass.toml").write_text(text.replace("duration_s = 2.0", "duration_s = 0.2"))
    temporary = folder / "tmp"
    temporary.mkdir()
    return [RESONARM, "run", "--mode", "free", "--scenario", folder / "mass.toml"], temporary


def run_mass(folder, *words, fault=0, hook=None, **more):
    """A run of `hooked`, and what is left in its TMPDIR."""
    command, temporary = hooked(folder, fault, hook)
    command = [*command, *words]
    environment = os.environ | {"TMPDIR": str(temporary)}
    done = subprocess.run([str(w) for w in command], capture_output=True, text=True, env=environment, timeout=60, **more)
    return done, list(temporary.iterdir())


@pytest.mark.parametrize("what", HOSTILE)
def test_an_fmu_that_ends_its_process_makes_no_run_succeed(what, tmp_path):
    """Licence checks and Fortran runtimes call exit(0), and a crash must say whose it is."""
    done, left = run_mass(tmp_path, hook=HOSTILE[what], check=False)
    assert done.returncode == 2 and not left, done
    assert "loading the FMU, " in done.stderr or "unloading the FMU, " in done.stderr, done.stderr


def test_an_fmu_that_exits_in_a_step_ends_the_run_as_a_fault(tmp_path):
    done, left = run_mass(tmp_path, "--record", tmp_path / "run.mcap", fault=10, check=False)
    assert done.returncode == 1 and not left, done
    assert "it ended its own process with exit code 0" in done.stderr
    assert inspected(tmp_path / "run.mcap")["integrity"] == {"state": "complete"}


def inspected(path):
    words = [RESONARM, "inspect", path, "--json"]
    return json.loads(subprocess.run([str(word) for word in words], capture_output=True, text=True, check=True).stdout)


def test_what_an_fmu_prints_is_not_in_the_document(tmp_path):
    done, left = run_mass(tmp_path, "--json", fault=12, check=True)
    assert json.loads(done.stdout)["samples"] < 999999 and not left
    assert done.stderr.count("999999") > 10


def test_no_folder_and_no_process_is_left_when_the_program_is_killed(tmp_path):
    """The folder of an instance is removed by a process that the FMU and the end of the program do not reach."""
    hook = ("constructor", "if (write(2, \"loaded\\n\", 7)) for (;;) pause();")
    command, temporary = hooked(tmp_path, hook=hook)
    environment = os.environ | {"TMPDIR": str(temporary)}
    with subprocess.Popen([str(word) for word in command], stderr=subprocess.PIPE, env=environment) as run:
        # The FMU's processes have this standard error, too: it ends when the last of them has ended.
        assert run.stderr.readline() == b"loaded\n"
        assert list(temporary.iterdir())
        run.kill()
        run.stderr.read()
        assert not list(temporary.iterdir())


@pytest.mark.parametrize("file", ["/dev/zero", "fifo"])
def test_only_a_regular_file_is_read_as_an_fmu(file, tmp_path):
    """A device has no end, and a pipe without a writer no beginning."""
    os.mkfifo(tmp_path / "fifo")
    (tmp_path / "mass.toml").write_text((Path("examples/fmu") / "mass.toml").read_text().replace("mass.fmu", file))
    command = [RESONARM, "run", "--mode", "free", "--scenario", tmp_path / "mass.toml"]
    words = [str(word) for word in command]
    done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=30)
    assert done.returncode == 2 and "it is not a regular file" in done.stderr, done


def test_the_mode_of_an_fmu_is_identified_from_its_readings(tmp_path):
    example = Path("examples/fmu")
    subprocess.run([sys.executable, example / "make.py", tmp_path / "mass.fmu", "2"], check=True)
    text = (example / "mass.toml").read_text().replace("cubic = 2e7", "cubic = 0.0")
    (tmp_path / "mass.toml").write_text(text)
    free_run(tmp_path / "mass.toml", tmp_path / "run.mcap")
    words = [RESONARM, "identify", tmp_path / "run.mcap", "--json"]
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True, check=True)
    [mode] = json.loads(done.stdout)["modes"]
    assert mode["mode"] is None and abs(mode["pole_frequency_hz"] - 20.0) < 0.05, mode

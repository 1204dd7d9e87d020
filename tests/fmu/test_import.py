"""FMUs as the structure under test: one that `resonarm fmu` wrote gives the bits of its own native run."""

import json
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
    before, after = STEPS.split("[arm]")[0], STEPS[STEPS.index("[simulation]"):]
    (folder / "imported.toml").write_text(before + section(arm.fmu, ARM) + after)
    return folder / "imported.toml"


def test_our_own_fmu_gives_the_bits_of_the_native_run(arm, imported, tmp_path):
    recorded = free_run(imported, tmp_path / "run.mcap")
    assert same(recorded.states, arm.native.states)
    assert same(recorded.column("/plant/samples", SENSORS), arm.native.column("/plant/samples", SENSORS))
    frames = [[(frame.id, bytes(frame.data)) for frame in run.frames] for run in (recorded, arm.native)]
    assert frames[0] == frames[1]
    for flags in ((), ("--readings",)):
        done = resim(tmp_path / "run.mcap", *flags)
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


FOLLOW = ("continue", "--drive", "tip.x", "--amplitude", "1", "--from-hz", "1", "--to-hz", "2")
REFUSED = {
    ("modes",): "an FMU is stepped and read",
    ("frf",): "an FMU is stepped and read",
    FOLLOW: "an FMU is stepped and read",
    ("demo",): "an FMU is stepped and read",
    ("run", "--bus", "vcan9"): "take the mode free or lockstep",
    ("fmu", "--out", "again.fmu"): "`kind` is fmu: it is one already",
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


def test_the_mode_of_an_fmu_is_identified_from_its_readings(tmp_path):
    example = Path("examples/fmu")
    subprocess.run([sys.executable, example / "make.py", tmp_path / "mass.fmu", "2"], check=True)
    text = (example / "mass.toml").read_text().replace("cubic = 2e7", "cubic = 0.0")
    (tmp_path / "mass.toml").write_text(text)
    free_run(tmp_path / "mass.toml", tmp_path / "run.mcap")
    words = [RESONARM, "identify", tmp_path / "run.mcap", "--json"]
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True, check=True)
    [mode] = json.loads(done.stdout)["modes"]
    assert mode["mode"] is None and abs(mode["frequency_hz"] - 20.0) < 0.05, mode

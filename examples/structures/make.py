"""Writes bracket.uff and the matrices of the plate; needs NumPy and pyuff 2.5.8."""

from pathlib import Path

import numpy as np
import pyuff

HERE = Path(__file__).parent


def bracket(path: Path) -> None:
    """Three modes at four nodes on a line; node 1 is clamped."""
    path.unlink(missing_ok=True)
    file = pyuff.UFF(str(path))
    units = {"units_code": 1, "units_description": "SI: Meter (newton)", "temp_mode": 2}
    file.write_sets(pyuff.prepare_164(length=1.0, force=1.0, temp=1.0, temp_offset=0.0, **units), "add")
    x, zeros = np.array([0.0, 0.1, 0.2, 0.3]), np.zeros(4)
    nodes = {"node_nums": [1, 2, 3, 4], "def_cs": [0] * 4, "disp_cs": [0] * 4, "color": [1] * 4}
    file.write_sets(pyuff.prepare_15(x=x, y=zeros, z=0.05 * x, **nodes), "add")
    line = {"trace_num": 1, "n_nodes": 4, "color": 1, "id": "bracket", "nodes": np.array([1, 2, 3, 4])}
    file.write_sets(pyuff.prepare_82(**line), "add")
    modes = [
        (63.4, 2.5, 0.004, [0.0, 0.3, 0.7, 1.0]),
        (212.25, 1.75, 0.006, [0.0, -0.6, -0.2, 1.0]),
        (388.0, 0.9, 0.011, [0.0, 0.1, 0.2, 0.25]),
    ]
    kind = {"analysis_type": 2, "data_ch": 2, "spec_data_type": 8, "data_type": 2, "n_data_per_node": 3}
    names = {f"id{line}": "NONE" for line in range(1, 6)}
    for number, (freq, mass, damping, shape) in enumerate(modes, 1):
        y = np.array(shape)
        values = {"r1": zeros, "r2": y, "r3": 0.1 * y} if number < 3 else {"r1": 1.1 * y, "r2": zeros, "r3": 0.1 * y}
        mode = {"mode_n": number, "freq": freq, "modal_m": mass, "modal_damp_vis": damping, "modal_damp_his": 0.0}
        data = {"model_type": 1, "load_case": 0, "node_nums": [1, 2, 3, 4], **kind, **names, **values, **mode}
        file.write_sets(pyuff.prepare_55(**data), "add")


def plate(folder: Path, n: int = 3) -> None:
    """n × n masses, each on a spring to the ground and on springs to its neighbours; damping C = aM + bK."""
    k = np.zeros((n * n, n * n))
    for a in range(n * n):
        k[a, a] += 2e4 * (1 + 0.13 * a)
        for b, is_there in ((a + 1, a % n < n - 1), (a + n, a // n < n - 1)):
            if is_there:
                stiffness = 3e5 * (1 + 0.1 * (b - a))
                k[a, a] += stiffness
                k[b, b] += stiffness
                k[a, b] -= stiffness
                k[b, a] -= stiffness
    m = np.diag(0.5 + 0.02 * np.arange(n * n))
    np.save(folder / "plate-m.npy", m)
    np.save(folder / "plate-c.npy", 0.4 * m + 2e-6 * k)
    np.save(folder / "plate-k.npy", np.asfortranarray(k))


if __name__ == "__main__":
    bracket(HERE / "bracket.uff")
    plate(HERE)

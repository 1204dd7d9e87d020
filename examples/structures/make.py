"""Writes bracket.uff, the matrices of the plate and free-plate.toml; needs NumPy, and pyuff 2.5.8 for the bracket."""

from pathlib import Path

import numpy as np
from numpy.polynomial import legendre

HERE = Path(__file__).parent


def bracket(path: Path) -> None:
    """Three modes at four nodes on a line; node 1 is clamped."""
    import pyuff

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


def free_modes(length: float, width: float, stiffness: float, area_mass: float, poisson: float, order: int = 12):
    """Natural frequencies in Hz, and shapes as functions of x and y, of a rectangular plate that nothing holds.

    W. Ritz (1909): w = Σ a_mn P_m(ξ) P_n(η) with Legendre's polynomials, ξ = 2x/length − 1 and η = 2y/width − 1. No edge is
    held, so that any polynomial is admissible, and the first three are the rigid motions. Kirchhoff's energy is
    D/2 ∫ w_xx² + w_yy² + 2ν w_xx w_yy + 2(1 − ν) w_xy² dA; with the integrals of P_m^(i) P_n^(j) over an axis it is a sum of
    products.
    """
    node, weight = legendre.leggauss(order + 1)
    axes = []
    for size in (length, width):
        values = [legendre.legval(node, legendre.legder(np.eye(order), d)) * (2 / size) ** d for d in range(3)]
        axes.append(lambda i, j, v=values, s=size: (v[i] * weight) @ v[j].T * s / 2)
    along, across = axes
    mass = area_mass * np.kron(along(0, 0), across(0, 0))
    mixed = np.kron(along(2, 0), across(0, 2))
    energy = (
        np.kron(along(2, 2), across(0, 0))
        + np.kron(along(0, 0), across(2, 2))
        + poisson * (mixed + mixed.T)
        + 2 * (1 - poisson) * np.kron(along(1, 1), across(1, 1))
    )
    scale = 1 / np.sqrt(np.diag(mass))  # the mass is diagonal: Legendre polynomials are orthogonal
    squared, vectors = np.linalg.eigh(stiffness * energy * np.outer(scale, scale))
    vectors = vectors * scale[:, None]
    # The rigid motions are the lowest polynomials, in place of any mixture of them.
    rigid = [0, order, 1]
    vectors[:, :3] = 0
    for mode, term in enumerate(rigid):
        vectors[term, mode] = scale[term]

    def shape(mode: int, x: float, y: float) -> float:
        terms = np.kron(*(legendre.legval(2 * p / s - 1, np.eye(order)) for p, s in ((x, length), (y, width))))
        return float(terms @ vectors[:, mode])

    return [0.0] * 3 + list(np.sqrt(squared[3:]) / (2 * np.pi)), shape


def free_plate(path: Path, modes: int = 13) -> None:
    """A free aluminium plate of 600 × 400 × 5 mm, with 20 points in a grid of 5 × 4."""
    length, width, thickness, modulus, density, poisson = 0.6, 0.4, 0.005, 70e9, 2700.0, 0.33
    bending = modulus * thickness**3 / (12 * (1 - poisson**2))
    frequencies, shape = free_modes(length, width, bending, density * thickness, poisson)
    points = {f"p{5 * j + i + 1}": (i / 4 * length, j / 3 * width) for j in range(4) for i in range(5)}
    rows = [[f"p{5 * j + i + 1}" for i in range(5)] for j in range(4)]
    lines = rows + [list(column) for column in zip(*rows, strict=True)]
    quoted = ", ".join("[" + ", ".join(f'"{name}"' for name in line) + "]" for line in lines)
    text = [
        "# A free aluminium plate of 600 x 400 x 5 mm: three rigid modes and ten of bending, by make.py. A corner is driven.",
        "",
        "[structure]",
        'kind = "modal"',
        'name = "free plate"',
        f"lines = [{quoted}]",
        "",
        "[structure.points]",
    ]
    text += [f"{name} = [{x:.3f}, {y:.6f}, 0.0]" for name, (x, y) in points.items()]
    for mode in range(modes):
        shapes = ", ".join(f'"{name}.z" = {shape(mode, x, y):.6g}' for name, (x, y) in points.items())
        damping = 0.0 if mode < 3 else 0.005
        text += ["", "[[structure.modes]]", f"frequency_hz = {frequencies[mode]:.6g}" if mode > 2 else "frequency_hz = 0.0", f"damping_ratio = {damping}"]
        text += [f"shape = {{ {shapes} }}"]
    text += ["", "[simulation]", "rate_hz = 4000.0", "", "[rig.exciter]", 'at = "p1.z"', "", "[excitation]"]
    text += ["amplitude = { exciter_x = 20.0 }"]
    text += ['profile = { waveform = "dwell", frequency_hz = 40.0, duration_s = 2.0, settle_s = 1.0 }', ""]
    path.write_text("\n".join(text), encoding="utf-8")


if __name__ == "__main__":
    bracket(HERE / "bracket.uff")
    plate(HERE)
    free_plate(HERE / "free-plate.toml")

//! Modes of matrices: K φ = ω² M φ.
//!
//! With K = L Lᵀ and y = Lᵀφ the eigenproblem is S y = λ y for S = L⁻¹ M L⁻ᵀ and λ = 1/ω² (G. H. Golub, C. F. Van Loan,
//! "Matrix Computations", 4th edition 2013, section 8.7): the lowest modes have the largest λ, the most exact ones.
//! φ = ω L⁻ᵀy has unit modal mass. Then ζᵢ = φᵢᵀCφᵢ/(2ωᵢ), if φᵢᵀCφⱼ vanishes for all pairs.
//!
//! **Degrees of freedom without mass**, such as the rotations of lumped masses, have zero rows in M. With b for
//! these and a for the others K_ba x_a + K_bb x_b = 0, so that x_b = G x_a with G = −K_bb⁻¹ K_ba, and M_aa,
//! K_aa + K_ab G are the matrices of x_a (R. J. Guyan, "Reduction of Stiffness and Mass Matrices", AIAA J. 3
//! (1965)), which is exact here. So is C_aa + C_ab G, if C_ba + C_bb G = 0, as holds for C = αM + βK.
//!
//! **A structure without supports** has a singular K. Then K + μM takes its place, with λ = 1/(ω² + μ), for a μ
//! that is first the least ratio of the diagonals and, once that is known, the lowest ω² that is not 0, which
//! keeps the digits.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

use nalgebra::{Cholesky, DMatrix, DVector, SymmetricEigen};
use serde::{Deserialize, Serialize};

use super::super::element::place;
use super::super::{ModeSection, StructureKind, StructureSection};
use super::error::MatrixError;
use super::{mtx, npy, of_file, unreadable};
use crate::structure::error::StructureSectionError;
use crate::text_file;
use resonarm_dynamics::structure::{BASE, MOST_MODES, Place};

/// Relative size of a Cholesky pivot, per row of the matrix, below which rounding is all that is left and the
/// matrix is singular.
const SINGULAR: f64 = 1e-14;
/// Ratio ω²/μ below which a mode is rigid.
const RIGID: f64 = 1e-9;
/// Ratio of a rigid mode's φᵢᵀCφⱼ to the largest of all below which the mode is undamped.
const RIGID_DAMPING: f64 = 1e-6;
/// Ratio of C_ba + C_bb G to its summands below which the damping follows the condensed degrees of freedom.
const MASSLESS_DAMPING: f64 = 1e-9;
/// Largest difference between mirrored entries of a symmetric matrix, relative to its largest entry.
const SYMMETRY_LIMIT: f64 = 1e-9;
/// Largest φᵢᵀCφⱼ/√(φᵢᵀCφᵢ φⱼᵀCφⱼ) of damping that counts as modal. Its effect on the modes is the square of
/// it.
const COUPLING_LIMIT: f64 = 1e-3;
/// Damping ratio below which damping is rounding.
const NO_DAMPING: f64 = 1e-12;
/// Iterations allowed per eigenvalue of a symmetric matrix; two or three are usual.
const MOST_ITERATIONS_A_ROW: usize = 50;

/// Files of a structure's matrices, as a scenario states them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MatricesSection {
    /// Mass matrix, kg, .npy of float64 or .mtx, symmetric and positive definite but for rows of zeros.
    pub mass: PathBuf,
    /// Damping matrix, N·s/m, symmetric; without it there is no damping.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub damping: Option<PathBuf>,
    /// Stiffness matrix, N/m, symmetric and positive semidefinite.
    pub stiffness: PathBuf,
    /// Number of lowest modes to keep, 1 to 32; without it all of them, if there are at most 32.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub modes: Option<usize>,
}

/// Square matrices in row-major order.
#[derive(Clone, Copy, Debug)]
pub struct Matrices<'a> {
    /// Mass matrix, kg, symmetric and positive definite but for rows of zeros.
    pub mass: &'a [f64],
    /// Stiffness matrix, N/m, symmetric and positive semidefinite.
    pub stiffness: &'a [f64],
    /// Damping matrix, N·s/m, symmetric; without it there is no damping.
    pub damping: Option<&'a [f64]>,
}

/// A matrix with the name that messages use: its file, or the name of an argument.
struct Named {
    matrix: DMatrix<f64>,
    path: PathBuf,
}

impl MatricesSection {
    /// Reads the files and computes the modes, with shapes at these degrees of freedom, which are rows of the
    /// matrices, from 0.
    pub(super) fn read(
        &self,
        folder: &Path,
        dofs: &BTreeMap<String, usize>,
        base: &BTreeMap<String, Vec<usize>>,
    ) -> Result<Vec<ModeSection>, StructureSectionError> {
        let sources = [self.mass.as_path(), self.stiffness.as_path()];
        sections(sources, self.damping.as_deref(), (dofs, base), self.modes, |path, rows| {
            let path = folder.join(path);
            let bytes = text_file::read_bytes(&path).map_err(unreadable(&path))?;
            let matrix = of_bytes(&path, &bytes).and_then(|matrix| checked(matrix, rows)).map_err(of_file(&path))?;
            Ok(Named { matrix, path })
        })
    }
}

impl StructureSection {
    /// Returns the modal structure of matrices: the lowest `modes`, or all if it is `None` and there are at
    /// most 32. It has shapes at `dofs`, degrees of freedom by their rows, from 0, and participation factors of
    /// `base`, the rows that move by 1 with the base along an axis.
    ///
    /// # Errors
    /// [`StructureSectionError::File`] with the fault of a matrix, by its name instead of a file's;
    /// [`StructureSectionError::Kept`], [`StructureSectionError::Row`], [`StructureSectionError::Missing`] and
    /// [`StructureSectionError::Place`] of the other arguments.
    pub fn from_matrices(
        matrices: &Matrices<'_>,
        dofs: &BTreeMap<String, usize>,
        base: &BTreeMap<String, Vec<usize>>,
        modes: Option<usize>,
    ) -> Result<StructureSection, StructureSectionError> {
        let sources = [("mass", matrices.mass), ("stiffness", matrices.stiffness)];
        let damping = matrices.damping.map(|damping| ("damping", damping));
        let modes = sections(sources, damping, (dofs, base), modes, |(name, numbers), rows| {
            let path = PathBuf::from(name);
            let matrix = square(numbers).and_then(|matrix| checked(matrix, rows)).map_err(of_file(&path))?;
            Ok(Named { matrix, path })
        })?;
        Ok(StructureSection { kind: StructureKind::Modal, modes, ..StructureSection::default() })
    }
}

/// Parses the matrix of a file, as Matrix Market by its extension or first line, else as NumPy.
fn of_bytes(path: &Path, bytes: &[u8]) -> Result<DMatrix<f64>, MatrixError> {
    let is_mtx = path.extension().is_some_and(|extension| extension == "mtx");
    if is_mtx || bytes.starts_with(mtx::BANNER.as_bytes()) { mtx::square(bytes) } else { npy::square(bytes) }
}

/// Returns the square matrix of numbers in row-major order.
fn square(numbers: &[f64]) -> Result<DMatrix<f64>, MatrixError> {
    let rows = numbers.len().isqrt();
    if rows * rows == numbers.len() && (1..=npy::MOST_ROWS).contains(&rows) {
        Ok(DMatrix::from_row_slice(rows, rows, numbers))
    } else {
        Err(MatrixError::Shape { got: format!("{} numbers", numbers.len()), most: npy::MOST_ROWS })
    }
}

/// Splits the rows of a mass matrix into those with mass and those without.
fn with_mass(mass: &DMatrix<f64>) -> [Vec<usize>; 2] {
    let (with, without) = (0..mass.nrows()).partition(|&row| mass.row(row).iter().any(|entry| *entry != 0.0));
    [with, without]
}

/// Returns how many modes to keep.
fn kept(modes: Option<usize>, mass: &DMatrix<f64>) -> Result<usize, StructureSectionError> {
    let [with_mass, _] = with_mass(mass);
    let rows = mass.nrows();
    let all = with_mass.len();
    let most = all.min(MOST_MODES);
    match modes {
        // A mass matrix of zeros has no modes. `sections` reports that, where the error can name the matrix.
        _ if all == 0 => Ok(0),
        None if all <= MOST_MODES => Ok(all),
        Some(keep) if (1..=most).contains(&keep) => Ok(keep),
        got => Err(StructureSectionError::Kept { got, rows, most }),
    }
}

/// Computes the lowest modes of M and K, and their damping ratios. `read` returns the matrix of a source, which must
/// have the given number of rows if it is known.
fn sections<Source>(
    [mass, stiffness]: [Source; 2],
    damping: Option<Source>,
    (dofs, base): (&BTreeMap<String, usize>, &BTreeMap<String, Vec<usize>>),
    modes: Option<usize>,
    read: impl Fn(Source, Option<usize>) -> Result<Named, StructureSectionError>,
) -> Result<Vec<ModeSection>, StructureSectionError> {
    let mass = read(mass, None)?;
    let rows = mass.matrix.nrows();
    check_dofs(dofs, rows)?;
    check_base(base, rows)?;
    // The number of modes follows from the mass matrix alone. It is checked before the other matrices, whose files
    // may be large, are read.
    let keep = kept(modes, &mass.matrix)?;
    let stiffness = read(stiffness, Some(rows))?;
    let damping = damping.map(|damping| read(damping, Some(rows))).transpose()?;
    let of_mass = || of_file(&mass.path);
    let without_mass = || {
        let fix = "every degree of freedom needs a mass, or a row of zeros, and is then condensed";
        of_mass()(MatrixError::NotPositive { fix })
    };
    if keep == 0 {
        return Err(without_mass());
    }
    let condensed = Condensed::new(&mass.matrix, &stiffness.matrix).map_err(of_file(&stiffness.path))?;
    // Every row with mass has an entry, but the mass matrix may still be singular, as with a mass that two rows
    // share.
    regular_factor(&condensed.mass).ok_or_else(without_mass)?;
    let modes = all_modes(&condensed, keep)
        .map_err(of_file(&stiffness.path))?
        .ok_or_else(|| of_mass()(MatrixError::NotSolved))?;
    let damping = match &damping {
        Some(Named { matrix, path }) => {
            let matrix = condensed.damping(matrix).map_err(of_file(path))?;
            damping_ratios(&matrix, &modes).map_err(of_file(path))?
        }
        None => vec![0.0; modes.len()],
    };
    // Γ = φᵀMr. Rows without mass add nothing.
    let participation = |shape: &DVector<f64>, rows: &Vec<usize>| -> f64 {
        let momentum = &mass.matrix * shape;
        rows.iter().map(|&row| momentum[row]).sum()
    };
    let section = |(mode, damping_ratio): (&Mode, f64)| {
        let shape = condensed.whole(&mode.shape);
        ModeSection {
            frequency_hz: mode.omega_rad_s / TAU,
            damping_ratio,
            shape: dofs.iter().map(|(name, &row)| (name.clone(), shape[row])).collect(),
            participation: base.iter().map(|(name, rows)| (name.clone(), participation(&shape, rows))).collect(),
        }
    };
    Ok(modes.iter().zip(damping).map(section).collect())
}

/// Matrices of the degrees of freedom with mass, after Guyan condensation of those without.
struct Condensed {
    with_mass: Vec<usize>,
    without: Vec<usize>,
    mass: DMatrix<f64>,
    stiffness: DMatrix<f64>,
    /// Matrix G, by which displacements without mass follow those with mass.
    follows: DMatrix<f64>,
}

impl Condensed {
    fn new(mass: &DMatrix<f64>, stiffness: &DMatrix<f64>) -> Result<Condensed, MatrixError> {
        let [with_mass, without] = with_mass(mass);
        let part = |of: &DMatrix<f64>, rows: &[usize], columns: &[usize]| of.select_rows(rows).select_columns(columns);
        let mut condensed = Condensed {
            mass: part(mass, &with_mass, &with_mass),
            stiffness: part(stiffness, &with_mass, &with_mass),
            follows: DMatrix::zeros(without.len(), with_mass.len()),
            with_mass,
            without,
        };
        if condensed.without.is_empty() {
            return Ok(condensed);
        }
        let [a, b] = [&condensed.with_mass, &condensed.without];
        // K_bb is positive definite exactly if every degree of freedom without mass is held by stiffness.
        let own = Cholesky::new(part(stiffness, b, b)).ok_or(MatrixError::MasslessFree { row: b[0] })?;
        condensed.follows = -own.solve(&part(stiffness, b, a));
        let reduced = &condensed.stiffness + part(stiffness, a, b) * &condensed.follows;
        // K_aa + K_ab G is symmetric in exact arithmetic. Averaging with the transpose restores that after
        // rounding, as the Cholesky factor reads one triangle only.
        condensed.stiffness = (&reduced + reduced.transpose()) * 0.5;
        Ok(condensed)
    }

    /// Condenses a damping matrix to C_aa + C_ab G.
    fn damping(&self, damping: &DMatrix<f64>) -> Result<DMatrix<f64>, MatrixError> {
        let part = |rows: &[usize], columns: &[usize]| damping.select_rows(rows).select_columns(columns);
        let [a, b] = [&self.with_mass, &self.without];
        if b.is_empty() {
            return Ok(damping.clone());
        }
        let direct = part(b, a);
        let by_own = part(b, b) * &self.follows;
        // C_ba + C_bb G must vanish: otherwise the velocities of the massless degrees of freedom enter their
        // own equilibrium, which then has dynamics of its own.
        let rest = &direct + &by_own;
        let most = MASSLESS_DAMPING * direct.amax().max(by_own.amax());
        if let Some(row) = (0..rest.nrows()).find(|&row| rest.row(row).amax() > most) {
            return Err(MatrixError::MasslessDamped { row: b[row] });
        }
        let reduced = part(a, a) + part(a, b) * &self.follows;
        Ok((&reduced + reduced.transpose()) * 0.5)
    }

    /// Expands displacements of the rows with mass to all rows.
    fn whole(&self, of_mass: &DVector<f64>) -> DVector<f64> {
        let mut whole = DVector::zeros(self.with_mass.len() + self.without.len());
        self.with_mass.iter().zip(of_mass).for_each(|(&row, value)| whole[row] = *value);
        self.without.iter().zip(&(&self.follows * of_mass)).for_each(|(&row, value)| whole[row] = *value);
        whole
    }
}

/// A mode normalised to unit modal mass.
struct Mode {
    omega_rad_s: f64,
    shape: DVector<f64>,
}

/// Computes the lowest modes of a supported or an unsupported structure; `None` if the eigenvalues don't
/// converge.
fn all_modes(of: &Condensed, keep: usize) -> Result<Option<Vec<Mode>>, MatrixError> {
    let mass = &of.mass;
    let stiffness = &of.stiffness;
    let rows = of.mass.nrows();
    if let Some(factor) = regular_factor(stiffness) {
        return Ok(modes(mass, &factor, keep, 0.0));
    }
    let ratio = |i: usize| stiffness[(i, i)] / mass[(i, i)];
    // The first shift only has to be of the order of the squared frequencies that occur, as the least ratio of the
    // diagonals is.
    let mut shift = (0..rows).map(ratio).filter(|ratio| *ratio > 0.0).fold(f64::INFINITY, f64::min);
    // A structure without any stiffness has only rigid modes, whatever the shift is.
    shift = if shift.is_finite() { shift } else { 1.0 };
    let mut found = None;
    // Two passes. The eigenvalues are 1/(ω² + μ), so a shift far above ω² costs digits of ω². The second pass
    // uses the lowest ω² that the first has found.
    for _ in 0..2 {
        let negative = MatrixError::NotPositive { fix: "with a negative stiffness the structure is at no stable rest" };
        let factor = Cholesky::new(stiffness + mass * shift).ok_or(negative)?.unpack();
        let Some(modes) = modes(mass, &factor, rows, shift) else { return Ok(None) };
        let lowest =
            modes.iter().map(|mode| mode.omega_rad_s * mode.omega_rad_s).find(|square| *square > RIGID * shift);
        found = Some((modes, shift));
        match lowest {
            Some(square) => shift = square,
            None => break,
        }
    }
    let Some((mut modes, shift)) = found else { return Ok(None) };
    for mode in &mut modes {
        let is_rigid = mode.omega_rad_s * mode.omega_rad_s <= RIGID * shift;
        // A rigid mode has exactly 0 Hz. The solver leaves rounding there, and an ω of rounding would give the
        // mode a stiffness.
        mode.omega_rad_s = if is_rigid { 0.0 } else { mode.omega_rad_s };
    }
    modes.truncate(keep);
    Ok(Some(modes))
}

/// Returns L of A = L Lᵀ, if A is positive definite beyond rounding.
fn regular_factor(a: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    // Without the test a singular A may pass: rounding turns a pivot of zero into a tiny positive one.
    let rows = a.nrows();
    let is_regular =
        |factor: &DMatrix<f64>| (0..rows).all(|i| factor[(i, i)] * factor[(i, i)] > SINGULAR * rows as f64 * a[(i, i)]);
    Cholesky::new(a.clone()).map(Cholesky::unpack).filter(is_regular)
}

/// Computes the lowest modes from the Cholesky factor L of K + μM.
fn modes(mass: &DMatrix<f64>, factor: &DMatrix<f64>, keep: usize, shift: f64) -> Option<Vec<Mode>> {
    let rows = mass.nrows();
    let half = factor.solve_lower_triangular(mass)?;
    let s = factor.solve_lower_triangular(&half.transpose())?;
    // Averaging restores the symmetry that the two triangular solves lose to rounding.
    let s = (&s + s.transpose()) * 0.5;
    let eigen = SymmetricEigen::try_new(s, f64::EPSILON, MOST_ITERATIONS_A_ROW * rows)?;
    let mut order: Vec<usize> = (0..rows).collect();
    // λ = 1/(ω² + μ), so that the largest comes first.
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let mode = |&column: &usize| {
        let shifted = 1.0 / libm::sqrt(eigen.eigenvalues[column]);
        let omega_rad_s = match shift == 0.0 {
            true => shifted,
            false => libm::sqrt((shifted * shifted - shift).max(0.0)),
        };
        let shape = factor.tr_solve_lower_triangular(&eigen.eigenvectors.column(column))? * shifted;
        // An eigenvector has no sign of its own. Making the largest entry positive fixes it, so that results
        // are reproducible.
        let sign = if shape[shape.iamax()] < 0.0 { -1.0 } else { 1.0 };
        omega_rad_s.is_finite().then(|| Mode { omega_rad_s, shape: shape * sign })
    };
    order.iter().take(keep).map(mode).collect()
}

/// Returns the damping ratio ζ of each mode.
fn damping_ratios(damping: &DMatrix<f64>, modes: &[Mode]) -> Result<Vec<f64>, MatrixError> {
    let forces: Vec<DVector<f64>> = modes.iter().map(|mode| damping * &mode.shape).collect();
    let of = |i: usize, j: usize| modes[i].shape.dot(&forces[j]);
    let own: Vec<f64> = (0..modes.len()).map(|i| of(i, i)).collect();
    // Measured against the largest of all, since a rigid mode has no frequency that its damping could be compared
    // with.
    let most = RIGID_DAMPING * own.iter().fold(0.0, |most, own| f64::max(most, own.abs()));
    let is_rigid = |mode: usize| modes[mode].omega_rad_s == 0.0;
    for i in (0..modes.len()).filter(|&mode| is_rigid(mode)) {
        if let Some(j) = (0..modes.len()).find(|&j| of(i, j).abs() > most) {
            return Err(MatrixError::RigidDamped { modes: [i + 1, j + 1], got: of(i, j) });
        }
    }
    let mut worst = (0.0, [0, 0]);
    for i in (0..modes.len()).filter(|&mode| !is_rigid(mode)) {
        for j in (0..i).filter(|&mode| !is_rigid(mode)) {
            // The floor keeps rounding of an undamped pair from looking like a coupling: 0/0 otherwise.
            let rounding = NO_DAMPING * 2.0 * libm::sqrt(modes[i].omega_rad_s * modes[j].omega_rad_s);
            let coupling = of(i, j).abs() / libm::sqrt((own[i] * own[j]).max(0.0)).max(rounding);
            if coupling > worst.0 {
                worst = (coupling, [j + 1, i + 1]);
            }
        }
    }
    match worst {
        (coupling, modes) if coupling > COUPLING_LIMIT => {
            Err(MatrixError::Coupled { modes, coupling, most: COUPLING_LIMIT })
        }
        _ => {
            let ratio = |(own, mode): (&f64, &Mode)| {
                if mode.omega_rad_s == 0.0 { 0.0 } else { own / (2.0 * mode.omega_rad_s) }
            };
            Ok(own.iter().zip(modes).map(ratio).collect())
        }
    }
}

/// Checks that the matrix is symmetric, and has the given number of rows if it is known.
fn checked(matrix: DMatrix<f64>, rows: Option<usize>) -> Result<DMatrix<f64>, MatrixError> {
    let got = matrix.nrows();
    match rows {
        Some(expected) if got != expected => Err(MatrixError::Size { got, expected }),
        _ => check_symmetric(matrix),
    }
}

fn check_symmetric(matrix: DMatrix<f64>) -> Result<DMatrix<f64>, MatrixError> {
    let rows = matrix.nrows();
    let at = |k: usize| (k / rows, k % rows);
    // Finite first: a comparison with NaN is false, so a NaN would pass as symmetric.
    if let Some((row, column)) = (0..rows * rows).map(at).find(|&at| !matrix[at].is_finite()) {
        return Err(MatrixError::NotFinite { row, column, got: matrix[(row, column)] });
    }
    let most = SYMMETRY_LIMIT * matrix.amax();
    let differs = |&(row, column): &(usize, usize)| (matrix[(row, column)] - matrix[(column, row)]).abs() > most;
    match (0..rows * rows).map(at).find(differs) {
        Some((row, column)) => {
            Err(MatrixError::NotSymmetric { row, column, got: [matrix[(row, column)], matrix[(column, row)]] })
        }
        None => Ok(matrix),
    }
}

fn check_dofs(dofs: &BTreeMap<String, usize>, rows: usize) -> Result<(), StructureSectionError> {
    if dofs.is_empty() {
        let fix = "name degrees of freedom by their rows, from 0, in a table [structure.dofs], as \"tip.x\" = 0";
        return Err(StructureSectionError::Missing { missing: "`dofs` are", fix });
    }
    for (name, &row) in dofs {
        if !matches!(place(name)?, Place::Dof { .. }) {
            return Err(StructureSectionError::Place { got: name.clone() });
        }
        if row >= rows {
            return Err(StructureSectionError::Row { name: name.clone(), got: row, rows });
        }
    }
    Ok(())
}

fn check_base(base: &BTreeMap<String, Vec<usize>>, rows: usize) -> Result<(), StructureSectionError> {
    for (name, moved) in base {
        if !matches!(place(name)?, Place::Dof { point, .. } if point == BASE) {
            return Err(StructureSectionError::Base { got: name.clone() });
        }
        if let Some(&got) = moved.iter().find(|&&row| row >= rows) {
            return Err(StructureSectionError::Row { name: name.clone(), got, rows });
        }
    }
    Ok(())
}

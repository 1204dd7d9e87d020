//! Modes of matrices: K φ = ω² M φ.
//!
//! With K = L Lᵀ and y = Lᵀφ the eigenproblem is S y = λ y for S = L⁻¹ M L⁻ᵀ and λ = 1/ω² (G. H. Golub, C. F. Van Loan,
//! "Matrix Computations", 4th edition 2013, section 8.7): the lowest modes have the largest λ, the most exact ones.
//! φ = ω L⁻ᵀy has unit modal mass. Then ζᵢ = φᵢᵀCφᵢ/(2ωᵢ), if φᵢᵀCφⱼ vanishes for all pairs.

use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

use nalgebra::{Cholesky, DMatrix, DVector, SymmetricEigen};
use serde::{Deserialize, Serialize};

use super::super::element::place;
use super::super::{ModeSection, StructureKind, StructureSection, StructureSectionError};
use super::error::MatrixError;
use super::{mtx, npy, of_file, unreadable};
use crate::text_file;
use resonarm_dynamics::structure::{MOST_MODES, Place};

/// How far entries of a symmetric matrix may differ from their mirror images, over the largest.
const SYMMETRY_LIMIT: f64 = 1e-9;
/// The most of φᵢᵀCφⱼ over √(φᵢᵀCφᵢ φⱼᵀCφⱼ) of damping that counts as modal: the square of it is what it changes.
const COUPLING_LIMIT: f64 = 1e-3;
/// Damping of modes below this, over 2ω, is rounding.
const NO_DAMPING: f64 = 1e-12;
/// Iterations for an eigenvalue of a symmetric matrix, which takes two or three.
const MOST_ITERATIONS_A_ROW: usize = 50;

/// The files of a structure's matrices.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MatricesSection {
    /// Mass matrix, kg, .npy of float64 or .mtx, symmetric and positive definite.
    pub mass: PathBuf,
    /// Damping matrix, N·s/m, symmetric; without it there is no damping.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub damping: Option<PathBuf>,
    /// Stiffness matrix, N/m, symmetric and positive definite.
    pub stiffness: PathBuf,
    /// How many modes to keep, the lowest, 1 to 32; without it all, if there are not more.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub modes: Option<usize>,
}

/// Square matrices, by rows.
#[derive(Clone, Copy, Debug)]
pub struct Matrices<'a> {
    /// Mass matrix, kg, symmetric and positive definite.
    pub mass: &'a [f64],
    /// Stiffness matrix, N/m, symmetric and positive definite.
    pub stiffness: &'a [f64],
    /// Damping matrix, N·s/m, symmetric; without it there is no damping.
    pub damping: Option<&'a [f64]>,
}

/// A matrix, and what messages call it: its file, or its name.
struct Named {
    matrix: DMatrix<f64>,
    path: PathBuf,
}

impl MatricesSection {
    /// The modes, with shapes at these degrees of freedom: rows of the matrices, from 0.
    pub(super) fn read(
        &self,
        folder: &Path,
        dofs: &BTreeMap<String, usize>,
    ) -> Result<Vec<ModeSection>, StructureSectionError> {
        let read = |path: &Path, rows| {
            let path = folder.join(path);
            let bytes = text_file::read_bytes(&path).map_err(unreadable(&path))?;
            let matrix = of_bytes(&path, &bytes).and_then(|matrix| checked(matrix, rows)).map_err(of_file(&path))?;
            Ok::<_, StructureSectionError>(Named { matrix, path })
        };
        let mass = read(&self.mass, None)?;
        let rows = mass.matrix.nrows();
        check_dofs(dofs, rows)?;
        let keep = kept(self.modes, rows)?;
        let stiffness = read(&self.stiffness, Some(rows))?;
        let damping = self.damping.as_deref().map(|path| read(path, Some(rows))).transpose()?;
        sections([mass, stiffness], damping, dofs, keep)
    }
}

impl StructureSection {
    /// The modal structure of matrices: the lowest `modes`, all if it is `None` and there are not more than 32, with
    /// shapes at `dofs`, degrees of freedom by their rows, from 0.
    ///
    /// # Errors
    /// [`StructureSectionError::File`] says what is wrong with a matrix, by its name in place of a file's;
    /// [`StructureSectionError::Kept`], [`StructureSectionError::Row`], [`StructureSectionError::Missing`] and
    /// [`StructureSectionError::Place`] of the other arguments.
    pub fn from_matrices(
        matrices: &Matrices<'_>,
        dofs: &BTreeMap<String, usize>,
        modes: Option<usize>,
    ) -> Result<StructureSection, StructureSectionError> {
        let named = |name: &str, numbers: &[f64], rows| {
            let path = PathBuf::from(name);
            let matrix = square(numbers).and_then(|matrix| checked(matrix, rows)).map_err(of_file(&path))?;
            Ok::<_, StructureSectionError>(Named { matrix, path })
        };
        let mass = named("mass", matrices.mass, None)?;
        let rows = mass.matrix.nrows();
        check_dofs(dofs, rows)?;
        let keep = kept(modes, rows)?;
        let stiffness = named("stiffness", matrices.stiffness, Some(rows))?;
        let damping = matrices.damping.map(|damping| named("damping", damping, Some(rows))).transpose()?;
        let modes = sections([mass, stiffness], damping, dofs, keep)?;
        Ok(StructureSection { kind: StructureKind::Modal, modes, ..StructureSection::default() })
    }
}

/// The matrix of a file, of Matrix Market by its ending or first line, else of NumPy.
fn of_bytes(path: &Path, bytes: &[u8]) -> Result<DMatrix<f64>, MatrixError> {
    let is_mtx = path.extension().is_some_and(|extension| extension == "mtx");
    if is_mtx || bytes.starts_with(mtx::BANNER.as_bytes()) { mtx::square(bytes) } else { npy::square(bytes) }
}

/// The matrix of numbers by rows.
fn square(numbers: &[f64]) -> Result<DMatrix<f64>, MatrixError> {
    let rows = numbers.len().isqrt();
    if rows * rows == numbers.len() && (1..=npy::MOST_ROWS).contains(&rows) {
        Ok(DMatrix::from_row_slice(rows, rows, numbers))
    } else {
        Err(MatrixError::Shape { got: format!("{} numbers", numbers.len()), most: npy::MOST_ROWS })
    }
}

/// How many modes to keep.
fn kept(modes: Option<usize>, rows: usize) -> Result<usize, StructureSectionError> {
    let most = rows.min(MOST_MODES);
    match modes {
        None if rows <= MOST_MODES => Ok(rows),
        Some(keep) if (1..=most).contains(&keep) => Ok(keep),
        got => Err(StructureSectionError::Kept { got, rows, most }),
    }
}

/// The lowest modes of M and K, and their damping ratios.
fn sections(
    [mass, stiffness]: [Named; 2],
    damping: Option<Named>,
    dofs: &BTreeMap<String, usize>,
    keep: usize,
) -> Result<Vec<ModeSection>, StructureSectionError> {
    let of_mass = || of_file(&mass.path);
    if Cholesky::new(mass.matrix.clone()).is_none() {
        return Err(of_mass()(MatrixError::NotPositive { fix: "every degree of freedom needs a mass" }));
    }
    let fix = "the structure must be held, so that no mode has the frequency 0";
    let factor = Cholesky::new(stiffness.matrix)
        .ok_or_else(|| of_file(&stiffness.path)(MatrixError::NotPositive { fix }))?
        .unpack();
    let modes = modes(&mass.matrix, &factor, keep).ok_or_else(|| of_mass()(MatrixError::NotSolved))?;
    let damping = match &damping {
        Some(Named { matrix, path }) => damping_ratios(matrix, &modes).map_err(of_file(path))?,
        None => vec![0.0; modes.len()],
    };
    let section = |(Mode { omega_rad_s, shape }, damping_ratio): (&Mode, f64)| ModeSection {
        frequency_hz: omega_rad_s / TAU,
        damping_ratio,
        shape: dofs.iter().map(|(name, &row)| (name.clone(), shape[row])).collect(),
    };
    Ok(modes.iter().zip(damping).map(section).collect())
}

/// A mode of unit modal mass.
struct Mode {
    omega_rad_s: f64,
    shape: DVector<f64>,
}

/// The lowest modes.
fn modes(mass: &DMatrix<f64>, factor: &DMatrix<f64>, keep: usize) -> Option<Vec<Mode>> {
    let rows = mass.nrows();
    let half = factor.solve_lower_triangular(mass)?;
    let s = factor.solve_lower_triangular(&half.transpose())?;
    let s = (&s + s.transpose()) * 0.5;
    let eigen = SymmetricEigen::try_new(s, f64::EPSILON, MOST_ITERATIONS_A_ROW * rows)?;
    let mut order: Vec<usize> = (0..rows).collect();
    order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
    let mode = |&column: &usize| {
        let omega_rad_s = 1.0 / libm::sqrt(eigen.eigenvalues[column]);
        let shape = factor.tr_solve_lower_triangular(&eigen.eigenvectors.column(column))? * omega_rad_s;
        // The sign of an eigenvector is open: the largest entry is positive.
        let sign = if shape[shape.iamax()] < 0.0 { -1.0 } else { 1.0 };
        omega_rad_s.is_finite().then(|| Mode { omega_rad_s, shape: shape * sign })
    };
    order.iter().take(keep).map(mode).collect()
}

/// ζ of each mode.
fn damping_ratios(damping: &DMatrix<f64>, modes: &[Mode]) -> Result<Vec<f64>, MatrixError> {
    let forces: Vec<DVector<f64>> = modes.iter().map(|mode| damping * &mode.shape).collect();
    let of = |i: usize, j: usize| modes[i].shape.dot(&forces[j]);
    let own: Vec<f64> = (0..modes.len()).map(|i| of(i, i)).collect();
    let mut worst = (0.0, [0, 0]);
    for i in 0..modes.len() {
        for j in 0..i {
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
        _ => Ok(own.iter().zip(modes).map(|(own, mode)| own / (2.0 * mode.omega_rad_s)).collect()),
    }
}

/// The matrix, if it is symmetric, and of so many rows if that is known.
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

//! Columns of a matrix as slices.

use nalgebra::DMatrix;

/// Column `index` of `matrix`.
pub fn column(matrix: &DMatrix<f64>, index: usize) -> &[f64] {
    matrix.column(index).data.into_slice()
}

/// Mutable column `index` of `matrix`.
pub fn column_mut(matrix: &mut DMatrix<f64>, index: usize) -> &mut [f64] {
    matrix.column_mut(index).data.into_slice_mut()
}

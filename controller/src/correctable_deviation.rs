//! The part of a tool deviation that the joints can correct with motions in proportion to it.
//!
//! Near a singular posture, with the arm stretched or two of its axes in line, the joints hardly move the tool along one direction u: the
//! Jacobian has a singular value σ near zero. An exact correction of a deviation d along u moves the joints by d/σ, without bound. Below σ₀ =
//! [`LEAST_SHARE`] of the largest singular value, the controller corrects only the part
//!
//! `f = σ²/(σ² + λ²)`, `λ² = σ₀² (1 − (σ/σ₀)²)`
//!
//! of d, the solution of least squares damped by λ in that direction alone (Nakamura & Hanafusa 1986, J. Dyn. Syst. Meas. Control 108:163;
//! Maciejewski & Klein 1988, J. Robot. Syst. 5:527). The joints then move by at most d/(2 σ₀). The factor f reaches one continuously at σ₀.
//! All other directions keep their deviation.

use nalgebra::{DMatrix, Matrix3, Vector3};

/// σ₀ over the largest singular value.
pub const LEAST_SHARE: f64 = 0.05;

/// The part of `deviation`, m, that the joints correct; `jacobian` is that of the tool, 6×n with the linear rows first. Base frame.
pub fn correctable_deviation(jacobian: &DMatrix<f64>, deviation: Vector3<f64>) -> Vector3<f64> {
    // The loop adds up column by column, because a transposed view of a dynamic number of columns would be allocated.
    let squares = jacobian.column_iter().fold(Matrix3::zeros(), |squares: Matrix3<f64>, column| {
        let linear = column.fixed_rows::<3>(0);
        squares + linear * linear.transpose()
    });
    let eigen = squares.symmetric_eigen();
    let least = LEAST_SHARE * LEAST_SHARE * eigen.eigenvalues.max();
    let mut correctable = deviation;
    for (square, direction) in eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()) {
        let square = square.max(0.0);
        if square < least {
            let damping = least - square;
            correctable -= direction * (damping / (square + damping) * direction.dot(&deviation));
        }
    }
    correctable
}

#[cfg(test)]
mod tests {
    use super::{LEAST_SHARE, correctable_deviation};
    use nalgebra::{DMatrix, Matrix3, Vector3, dmatrix};

    /// Two links of 1 m in the x–y plane, bent by `elbow`, and a lift along z; at `elbow` = 0 the arm is stretched along x.
    fn arm(elbow: f64) -> DMatrix<f64> {
        let (s, c) = elbow.sin_cos();
        let mut jacobian = DMatrix::zeros(6, 3);
        jacobian.view_mut((0, 0), (3, 3)).copy_from(&dmatrix![-s, -s, 0.0; 1.0 + c, c, 0.0; 0.0, 0.0, 1.0]);
        jacobian
    }

    #[test]
    fn a_bent_arm_takes_all_of_it_out() {
        let deviation = Vector3::new(1e-4, -2e-4, 3e-4);
        assert_eq!(correctable_deviation(&arm(1.0), deviation), deviation);
    }

    /// The test compares with damped least squares in the weak direction alone, by the singular value decomposition.
    #[test]
    fn where_it_is_stretched_it_is_damped_least_squares() {
        let deviation = Vector3::new(5e-4, 2e-4, -1e-4);
        for elbow in [0.0, 1e-3, 0.02, 0.05, 0.1] {
            let jacobian = arm(elbow);
            let linear: Matrix3<f64> = jacobian.fixed_view::<3, 3>(0, 0).into();
            let svd = linear.svd(true, true);
            let least = LEAST_SHARE * svd.singular_values.max();
            let (u, v_t) = (svd.u.expect("left"), svd.v_t.expect("right"));
            let mut damped = Vector3::zeros();
            for i in 0..3 {
                let sigma = svd.singular_values[i];
                let lambda = (least * least - sigma * sigma).max(0.0);
                let gain = if sigma == 0.0 { 0.0 } else { sigma / (sigma * sigma + lambda) };
                damped += v_t.row(i).transpose() * (gain * u.column(i).dot(&deviation));
            }
            let (asked, most) =
                (correctable_deviation(&jacobian, deviation), deviation.norm() / (2.0 * least));
            let off = (linear * damped - asked).norm() / deviation.norm();
            println!(
                "elbow {elbow}: off by {off:.1e}, margin 1e-9; joints move by {:.2e}, at most {most:.2e}",
                damped.norm()
            );
            assert!(off < 1e-9 && damped.norm() <= most + deviation.norm());
        }
        assert!((correctable_deviation(&arm(0.02), deviation) - deviation).norm() > 0.1 * deviation.norm());
    }

    #[test]
    fn what_no_joint_can_move_is_left_out() {
        let mut planar = arm(1.0);
        planar.fixed_rows_mut::<1>(2).fill(0.0);
        assert_eq!(correctable_deviation(&planar, Vector3::new(1e-4, 1e-4, 5e-4)).z, 0.0);
        assert_eq!(
            correctable_deviation(&DMatrix::zeros(6, 2), Vector3::new(1.0, 2.0, 3.0)),
            Vector3::new(1.0, 2.0, 3.0)
        );
    }
}

//! The integrator of the tests: the classical Runge–Kutta method.

/// One step of the classical Runge–Kutta method (Kutta 1901) for q̇ = v, v̇ = acceleration(q, v).
pub fn rk4(q: &mut [f64], v: &mut [f64], dt: f64, mut acceleration: impl FnMut(&[f64], &[f64], &mut [f64])) {
    let n = q.len();
    let (q0, v0) = (q.to_vec(), v.to_vec());
    let (mut sum_q, mut sum_v, mut a) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    for (weight, next) in [(1.0, 0.5), (2.0, 0.5), (2.0, 1.0), (1.0, 0.0)] {
        acceleration(q, v, &mut a);
        for i in 0..n {
            sum_q[i] += weight * v[i];
            sum_v[i] += weight * a[i];
        }
        for i in 0..n {
            q[i] = q0[i] + next * dt * v[i];
            v[i] = v0[i] + next * dt * a[i];
        }
    }
    for i in 0..n {
        q[i] = q0[i] + dt / 6.0 * sum_q[i];
        v[i] = v0[i] + dt / 6.0 * sum_v[i];
    }
}

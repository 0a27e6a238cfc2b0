//! Tests of the minimiser against closed forms, a published table, known weights, and another algorithm.
use freeplay_predictor::gauss_newton::{NetworkErrors, Samples};
use freeplay_predictor::initialise::nguyen_widrow;
use freeplay_predictor::levenberg_marquardt::{MinimiseError, Outcome, Settings, Stop, minimise};
use freeplay_predictor::network::weight_count;
use freeplay_predictor::normal_equations::NormalEquations;
use freeplay_predictor::{Activation, LeastSquares, Network};
use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::ops::ControlFlow;

/// A problem given by a function of the weights that returns the errors and their derivatives.
struct ByHand<F> {
    weights: usize,
    errors: usize,
    row: F,
}

impl<F: Fn(usize, &[f64]) -> (f64, Vec<f64>)> LeastSquares for ByHand<F> {
    fn weights(&self) -> usize {
        self.weights
    }

    fn errors(&self) -> usize {
        self.errors
    }

    fn cost(&mut self, weights: &[f64]) -> f64 {
        (0..self.errors).map(|i| (self.row)(i, weights).0.powi(2)).sum()
    }

    fn linearise(&mut self, weights: &[f64], equations: &mut NormalEquations) {
        for i in 0..self.errors {
            let (error, jacobian) = (self.row)(i, weights);
            equations.add_row(error, &jacobian);
        }
    }
}

fn run(problem: &mut impl LeastSquares, start: Vec<f64>, settings: &Settings) -> Outcome {
    minimise(problem, start, settings, |_| ControlFlow::Continue(())).unwrap()
}

/// Settings for a minimum within the precision of the arithmetic.
fn exhaustive() -> Settings {
    Settings { min_gradient: 0.0, ..Settings::default() }
}

fn random_samples(count: usize, inputs: usize, seed: u64, truth: impl Fn(&[f64]) -> Vec<f64>) -> Samples {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let x: Vec<Vec<f64>> =
        (0..count).map(|_| (0..inputs).map(|_| rng.random_range(-1.0..1.0)).collect()).collect();
    let y: Vec<Vec<f64>> = x.iter().map(|x| truth(x)).collect();
    Samples {
        inputs: DMatrix::from_fn(count, inputs, |i, j| x[i][j]),
        outputs: DMatrix::from_fn(count, y[0].len(), |i, j| y[i][j]),
    }
}

fn noisy_samples(count: usize, seed: u64) -> Samples {
    let mut samples = random_samples(count, 2, seed, |x| vec![(2.0 * x[0]).sin() * x[1] + 0.3 * x[0]]);
    let mut rng = ChaCha8Rng::seed_from_u64(seed + 100);
    for i in 0..count {
        samples.outputs[(i, 0)] += rng.random_range(-0.1..0.1);
    }
    samples
}

#[test]
fn a_linear_network_ends_at_the_least_squares_solution() {
    let samples = random_samples(60, 4, 1, |x| vec![x[0] - x[1] * x[2], 0.5 + x[3].powi(2)]);
    let sizes = [4, 2];
    let mut problem = NetworkErrors::new(&sizes, Activation::Tanh, samples.clone(), None);
    let outcome = run(&mut problem, nguyen_widrow(&sizes, Activation::Tanh, 1), &exhaustive());
    let design = DMatrix::from_fn(60, 5, |i, j| if j == 0 { 1.0 } else { samples.inputs[(i, j - 1)] });
    let right = DMatrix::from_fn(60, 2, |i, j| samples.outputs[(i, j)]);
    let expected = design.svd(true, true).solve(&right, 0.0).unwrap();
    let worst = expected.iter().zip(&outcome.weights).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
    eprintln!("{:?} after {} epochs, largest difference {worst:.1e}", outcome.stop, outcome.best_epoch);
    assert!(outcome.history.last().unwrap().mse > 1.0e-3, "the fit leaves an error");
    // Only the damping mu keeps the first step from being exact.
    assert!(worst < 1.0e-7 && outcome.best_epoch < 20);
}

/// NIST Statistical Reference Datasets, nonlinear regression, Misra1a (lower difficulty): y = b1 (1 − exp(−b2 x)).
/// Certified: b1 = 238.94212918, b2 = 5.5015643181e-4, residual sum of squares 0.12455138894.
#[test]
fn misra1a_ends_at_the_certified_values_from_both_starts() {
    let y =
        [10.07, 14.73, 17.94, 23.93, 29.61, 35.18, 40.02, 44.82, 50.76, 55.05, 61.01, 66.40, 75.47, 81.78];
    let x = [77.6, 114.9, 141.1, 190.8, 239.9, 289.0, 332.8, 378.4, 434.8, 477.3, 536.8, 593.1, 689.1, 760.0];
    for start in [[500.0, 1.0e-4], [250.0, 5.0e-4]] {
        let row = |i: usize, b: &[f64]| {
            let decay = (-b[1] * x[i]).exp();
            (b[0] * (1.0 - decay) - y[i], vec![1.0 - decay, b[0] * x[i] * decay])
        };
        let mut problem = ByHand { weights: 2, errors: 14, row };
        let outcome = run(&mut problem, start.to_vec(), &exhaustive());
        let cost = problem.cost(&outcome.weights);
        let relative = [
            outcome.weights[0] / 2.389_421_291_8e2 - 1.0,
            outcome.weights[1] / 5.501_564_318_1e-4 - 1.0,
            cost / 1.245_513_889_4e-1 - 1.0,
        ];
        eprintln!("from {start:?}: {:?}, relative differences {relative:?}", outcome.stop);
        assert!(relative.iter().all(|r| r.abs() < 1.0e-8));
    }
}

#[test]
fn rosenbrocks_valley_is_followed_to_its_end() {
    let row = |i: usize, w: &[f64]| match i {
        0 => (10.0 * (w[1] - w[0] * w[0]), vec![-20.0 * w[0], 10.0]),
        _ => (1.0 - w[0], vec![-1.0, 0.0]),
    };
    let outcome = run(&mut ByHand { weights: 2, errors: 2, row }, vec![-1.2, 1.0], &exhaustive());
    eprintln!("{:?} {:?} in {} epochs", outcome.weights, outcome.stop, outcome.best_epoch);
    assert!(outcome.weights.iter().all(|w| (w - 1.0).abs() < 1.0e-9));
    let falling = outcome.history.windows(2).all(|pair| pair[1].mse < pair[0].mse);
    assert!(falling, "every accepted step lowers the error");
}

#[test]
fn a_network_finds_back_to_the_weights_that_made_the_data() {
    let sizes = [3, 4, 3, 2];
    for activation in [Activation::Tanh, Activation::Logistic] {
        let teacher = nguyen_widrow(&sizes, activation, 8);
        let network = Network::new(&sizes, activation, teacher.clone()).unwrap();
        let samples = random_samples(300, 3, 2, |x| network.forward(x, &mut network.scratch()).to_vec());
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let start: Vec<f64> = teacher.iter().map(|w| w + rng.random_range(-0.05..0.05)).collect();
        let mut problem = NetworkErrors::new(&sizes, activation, samples, None);
        let before = problem.cost(&start);
        let outcome = run(&mut problem, start, &exhaustive());
        let worst = teacher.iter().zip(&outcome.weights).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
        let after = problem.cost(&outcome.weights);
        eprintln!(
            "{activation:?}: cost {before:.1e} -> {after:.1e}, weights off by {worst:.1e}, {:?}",
            outcome.stop
        );
        assert!(before > 1.0e-3 && after < 1.0e-20 && worst < 1.0e-7);
    }
}

/// Gauss–Newton with step halving: a Jacobian by central differences of the streaming network and steps by singular
/// values. It shares neither derivatives nor linear algebra nor damping with the library.
fn gauss_newton(sizes: &[usize], samples: &Samples, start: &[f64]) -> Vec<f64> {
    let errors = |weights: &DVector<f64>| {
        let network = Network::new(sizes, Activation::Tanh, weights.iter().copied().collect()).unwrap();
        let mut scratch = network.scratch();
        DVector::from_fn(samples.inputs.nrows(), |i, _| {
            let x: Vec<f64> = samples.inputs.row(i).iter().copied().collect();
            network.forward(&x, &mut scratch)[0] - samples.outputs[(i, 0)]
        })
    };
    let mut weights = DVector::from_column_slice(start);
    for _ in 0..200 {
        let error = errors(&weights);
        let mut jacobian = DMatrix::zeros(error.len(), weights.len());
        for j in 0..weights.len() {
            let mut shifted = [weights.clone(), weights.clone()];
            shifted[0][j] += 1.0e-5;
            shifted[1][j] -= 1.0e-5;
            jacobian.set_column(j, &((errors(&shifted[0]) - errors(&shifted[1])) / 2.0e-5));
        }
        let step = jacobian.svd(true, true).solve(&-&error, 1.0e-10).unwrap();
        let shorter = (0..30).map(|k| &weights + &step * 0.5_f64.powi(k));
        match shorter.into_iter().find(|trial| errors(trial).norm_squared() < error.norm_squared()) {
            Some(better) => weights = better,
            None => break,
        }
    }
    weights.iter().copied().collect()
}

#[test]
fn the_minimum_is_the_one_another_algorithm_finds() {
    let sizes = [2, 3, 1];
    // Noisy data of a known network, and a start near it, so that there is one minimum nearby and a nonzero error.
    let teacher = nguyen_widrow(&sizes, Activation::Tanh, 2);
    let network = Network::new(&sizes, Activation::Tanh, teacher.clone()).unwrap();
    let mut samples = random_samples(200, 2, 5, |x| network.forward(x, &mut network.scratch()).to_vec());
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    samples.outputs.column_mut(0).iter_mut().for_each(|y| *y += rng.random_range(-0.05..0.05));
    let start: Vec<f64> = teacher.iter().map(|w| w + rng.random_range(-0.1..0.1)).collect();
    let mut problem = NetworkErrors::new(&sizes, Activation::Tanh, samples.clone(), None);
    let ours = run(&mut problem, start.clone(), &exhaustive()).weights;
    let theirs = gauss_newton(&sizes, &samples, &start);
    let largest = |a: &[f64], b: &[f64]| a.iter().zip(b).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
    let costs = [&start, &teacher, &ours, &theirs].map(|weights| problem.cost(weights));
    let (worst, moved) = (largest(&ours, &theirs), largest(&ours, &start));
    eprintln!(
        "cost at start, teacher, our minimum, theirs: {costs:?}; weights differ by {worst:.1e}, moved {moved:.1e}"
    );
    assert!(costs[2] > 1.0e-2 && costs[2] < costs[1] && costs[2] < 0.5 * costs[0] && moved > 1.0e-2);
    assert!((costs[2] / costs[3] - 1.0).abs() < 1.0e-11 && worst < 1.0e-5);
}

#[test]
fn a_rising_validation_error_stops_and_the_best_weights_return() {
    let sizes = [2, 12, 1];
    let mut problem =
        NetworkErrors::new(&sizes, Activation::Tanh, noisy_samples(60, 7), Some(noisy_samples(60, 8)));
    let settings = Settings::default();
    let outcome = run(&mut problem, nguyen_widrow(&sizes, Activation::Tanh, 1), &settings);
    assert_eq!(outcome.stop, Stop::Validation);
    let errors: Vec<f64> = outcome.history.iter().map(|e| e.validation_mse.unwrap()).collect();
    let lowest = errors.iter().copied().fold(f64::INFINITY, f64::min);
    assert_eq!(errors[outcome.best_epoch], lowest);
    assert_eq!(problem.validation(&outcome.weights), Some(lowest));
    assert_eq!(outcome.history.len() - 1 - outcome.best_epoch, settings.max_fail);
    assert!(
        outcome.best_epoch > 0
            && outcome.history.last().unwrap().mse < outcome.history[outcome.best_epoch].mse
    );
}

#[test]
fn the_other_reasons_to_stop_are_named() {
    let sizes = [2, 3, 1];
    let start = nguyen_widrow(&sizes, Activation::Tanh, 2);
    let stop = |settings: &Settings| {
        let mut problem = NetworkErrors::new(&sizes, Activation::Tanh, noisy_samples(50, 5), None);
        run(&mut problem, start.clone(), settings)
    };
    let few = stop(&Settings { epochs: 3, ..Settings::default() });
    assert_eq!((few.stop, few.history.len(), few.best_epoch), (Stop::Epochs, 4, 3));
    let goal = stop(&Settings { goal: 0.05, ..Settings::default() });
    assert_eq!(goal.stop, Stop::Goal);
    assert!(goal.history.last().unwrap().mse <= 0.05);
    let flat = stop(&Settings { min_gradient: 1.0e-3, ..Settings::default() });
    assert_eq!(flat.stop, Stop::Gradient);
    assert_eq!(stop(&exhaustive()).stop, Stop::MuMax);
    let mut problem = NetworkErrors::new(&sizes, Activation::Tanh, noisy_samples(50, 5), None);
    let mut seen = 0;
    let asked = minimise(&mut problem, start.clone(), &Settings::default(), |epoch| {
        seen += 1;
        if epoch.epoch == 2 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    assert_eq!((asked.unwrap().stop, seen), (Stop::Interrupted, 3));
}

#[test]
fn mu_follows_the_documented_rule_and_the_gradient_is_that_of_the_error() {
    let sizes = [2, 3, 1];
    let mut problem = NetworkErrors::new(&sizes, Activation::Tanh, noisy_samples(50, 5), None);
    let start = nguyen_widrow(&sizes, Activation::Tanh, 2);
    let outcome = run(&mut problem, start.clone(), &Settings { epochs: 30, ..exhaustive() });
    assert_eq!(outcome.history[0].mu, 1.0e-3);
    let powers: Vec<f64> = outcome.history.windows(2).map(|pair| (pair[1].mu / pair[0].mu).log10()).collect();
    assert!(powers.iter().all(|p| (p - p.round()).abs() < 1.0e-9 && *p > -1.5), "{powers:?}");
    assert!(powers.iter().any(|p| *p < -0.5) && powers.iter().any(|p| *p > -0.5), "both happen: {powers:?}");
    let slope = |j: usize| {
        let mut at = |by: f64| {
            let mut weights = start.clone();
            weights[j] += by;
            problem.cost(&weights) / 50.0
        };
        (at(1.0e-6) - at(-1.0e-6)) / 2.0e-6
    };
    let norm = (0..weight_count(&sizes)).map(slope).map(|s| s * s).sum::<f64>().sqrt();
    let reported = outcome.history[0].gradient;
    eprintln!("gradient {reported:.9}, by differences {norm:.9}");
    assert!(reported > 1.0e-2 && (reported / norm - 1.0).abs() < 1.0e-7);
}

#[test]
fn senseless_settings_and_starts_are_refused() {
    let row = |_: usize, w: &[f64]| (w[0], vec![1.0]);
    let attempt = |settings: &Settings, start: Vec<f64>| {
        let mut problem = ByHand { weights: 1, errors: 1, row };
        minimise(&mut problem, start, settings, |_| ControlFlow::Continue(())).unwrap_err()
    };
    let default = Settings::default();
    let table = [
        ("goal", Settings { goal: -1.0, ..default }),
        ("min_gradient", Settings { min_gradient: f64::NAN, ..default }),
        ("mu", Settings { mu: 0.0, ..default }),
        ("mu", Settings { mu: 1.0e11, ..default }),
        ("mu_decrease", Settings { mu_decrease: 1.0, ..default }),
        ("mu_increase", Settings { mu_increase: 1.0, ..default }),
        ("mu_max", Settings { mu_max: f64::INFINITY, ..default }),
    ];
    for (expected, settings) in table {
        match attempt(&settings, vec![1.0]) {
            MinimiseError::BadSetting { name, .. } => assert_eq!(name, expected),
            other => panic!("{expected}: {other}"),
        }
    }
    assert_eq!(attempt(&default, vec![1.0, 2.0]), MinimiseError::WrongStart { given: 2, needed: 1 });
    assert!(matches!(attempt(&default, vec![f64::NAN]), MinimiseError::NonFiniteStart { .. }));
}

/// SciPy 1.17.1 (MINPACK's Levenberg–Marquardt, `least_squares(f, w0, method="lm", xtol=ftol=gtol=1e-15)`) on the same forty samples
/// from the same start: mean squared error and the network's outputs at −1, 0 and 1.
#[test]
fn the_minimum_is_the_one_scipy_finds() {
    const ERROR: f64 = 1.794_561_945_450_004_3e-4;
    const WEIGHTS: [f64; 10] = [
        1.373_636_068_116_931_3,
        1.446_026_418_231_553_4,
        0.068_263_452_229_154_21,
        1.434_625_764_152_050_3,
        1.758_181_865_260_318,
        -1.837_028_966_537_936_5,
        0.858_978_938_941_202_7,
        -3.092_874_598_211_540_4,
        3.065_615_747_659_284_5,
        1.755_156_071_250_25,
    ];
    let x = |i: usize| i as f64 / 39.0 * 2.0 - 1.0;
    let y = |x: f64| (3.0 * x).sin() + 0.3 * x * x + 0.02 * (17.0 * x).cos();
    let samples = Samples {
        inputs: DMatrix::from_fn(40, 1, |i, _| x(i)),
        outputs: DMatrix::from_fn(40, 1, |i, _| y(x(i))),
    };
    let sizes = [1, 3, 1];
    let mut problem = NetworkErrors::new(&sizes, Activation::Tanh, samples, None);
    let start = vec![0.2, 1.0, -0.5, 2.0, 0.4, -1.0, 0.1, 0.8, 0.5, -0.6];
    let begun = problem.cost(&start);
    let ours = run(&mut problem, start, &exhaustive()).weights;
    let (our_cost, their_cost) = (problem.cost(&ours), problem.cost(&WEIGHTS));
    let network = |weights: &[f64]| Network::new(&sizes, Activation::Tanh, weights.to_vec()).unwrap();
    let says = |weights: &[f64], x: f64| {
        let network = network(weights);
        network.forward(&[x], &mut network.scratch())[0]
    };
    let off =
        [-1.0, 0.0, 1.0].map(|x| (says(&ours, x) - says(&WEIGHTS, x)).abs()).into_iter().fold(0.0, f64::max);
    eprintln!(
        "cost from {begun:.3} to {our_cost:.15e}, SciPy's {their_cost:.15e}, recorded {:.15e}; outputs differ by {off:.1e}",
        40.0 * ERROR
    );
    assert!(begun > 1.0);
    assert!((their_cost / (40.0 * ERROR) - 1.0).abs() < 1e-6, "the weights were read in another order");
    assert!((our_cost / (40.0 * ERROR) - 1.0).abs() < 1e-9 && off < 1e-5);
}

//! Tests of trained models: known systems, closed against open loop, streaming against batch, invalid input.
use freeplay_predictor::activation::Activation;
use freeplay_predictor::baselines::persistence;
use freeplay_predictor::levenberg_marquardt::{Settings, Stop};
use freeplay_predictor::metrics::{by_part, score, skill};
use freeplay_predictor::narx::PredictError;
use freeplay_predictor::push_error::PushError;
use freeplay_predictor::split::{Fractions, Split, by_block};
use freeplay_predictor::training::{Recipe, TrainError, Trained};
use freeplay_predictor::window::{WindowError, targets, windows};
use freeplay_predictor::{Arx, Layout, Narx, Predictor, Provenance, Series, Window, train};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::convert::Infallible;
use std::ops::ControlFlow;

fn layout(input_lags: &[usize], output_lags: &[usize], horizon: usize) -> Layout {
    let (input_lags, output_lags) = (input_lags.to_vec(), output_lags.to_vec());
    Layout { input_lags, output_lags, horizon, input_at_target: false }
}

fn recipe(layout: Layout, hidden: &[usize]) -> Recipe {
    let settings = Settings { epochs: 100, ..Settings::default() };
    Recipe {
        layout,
        least_ranges: Vec::new(),
        hidden: hidden.to_vec(),
        activation: Activation::Tanh,
        seed: 1,
        settings,
        decay: false,
    }
}

fn fit(series: &Series, split: &Split, recipe: &Recipe) -> Result<Trained, TrainError> {
    train(series, split, recipe, Provenance::default(), |_| ControlFlow::Continue(()))
}

fn blocks(series: &Series, layout: &Layout) -> Split {
    let all = windows(series, layout.memory(), layout.horizon).unwrap();
    by_block(&all, Fractions::PAPER, layout.memory() + layout.horizon).unwrap()
}

/// Narendra and Parthasarathy (1990), Example 2: y\[k+1\] = y\[k\] y\[k−1\] (y\[k\] + 2.5) / (1 + y\[k\]² + y\[k−1\]²) + u\[k\].
fn narendra(samples: usize, seed: u64) -> (Vec<f64>, Vec<f64>) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let u: Vec<f64> = (0..samples).map(|_| rng.random_range(-2.0..2.0)).collect();
    let mut y = vec![0.0, 0.0];
    for k in 1..samples - 1 {
        let (now, before) = (y[k], y[k - 1]);
        y.push(now * before * (now + 2.5) / (1.0 + now * now + before * before) + u[k]);
    }
    (u, y)
}

/// Two runs of Narendra's system, a second output, and a constant second input.
fn narendra_series(samples: usize) -> Series {
    let mut series = Series::new(&["u", "constant"], &["y", "z"]).unwrap();
    for seed in [1, 2] {
        let (u, y) = narendra(samples, seed);
        let inputs = u.iter().flat_map(|u| [*u, 0.4]).collect();
        let outputs = y.iter().flat_map(|y| [*y, 1.0e-3 * (2.0 * y).sin()]).collect();
        series.push_run(&format!("seed {seed}"), inputs, outputs).unwrap();
    }
    series
}

/// y\[k+h\] = 0.6 y\[k\] − 0.3 y\[k−1\] + 0.5 u\[k\], stable, and exactly predictable h samples ahead.
fn delayed(samples: usize, horizon: usize) -> Series {
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let u: Vec<f64> = (0..samples).map(|_| rng.random_range(-1.0..1.0)).collect();
    let mut y = vec![0.0; horizon + 1];
    for k in 1..samples - horizon {
        y.push(0.6 * y[k] - 0.3 * y[k - 1] + 0.5 * u[k]);
    }
    let mut series = Series::new(&["u"], &["y"]).unwrap();
    series.push_run("delayed", u, y).unwrap();
    series
}

#[test]
fn a_known_nonlinear_system_is_learned_and_linear_models_are_beaten() {
    let (u, y) = narendra(1000, 3);
    let mut series = Series::new(&["u"], &["y"]).unwrap();
    series.push_run("narendra", u, y).unwrap();
    let layout = layout(&[0], &[0, 1], 1);
    let split = blocks(&series, &layout);
    let narx = fit(&series, &split, &recipe(layout.clone(), &[10])).unwrap().narx;
    let arx = Arx::fit(&series, &split, &layout).unwrap();
    let ours = by_part(&series, &split, |w| narx.predict(&series, w)).unwrap();
    let linear = by_part(&series, &split, |w| arx.predict(&series, w)).unwrap();
    let hold = by_part(&series, &split, |w| Ok::<_, Infallible>(persistence(&series, w))).unwrap();
    let skill = skill(&ours.test, &[&linear.test, &hold.test])[0].unwrap();
    eprintln!(
        "test: NARX {:?}\n  ARX {:?}\n  persistence {:?}\n  skill {skill}",
        ours.test, linear.test, hold.test
    );
    assert!(linear.test[0].mse < hold.test[0].mse && linear.test[0].mse > 0.1, "the system is not linear");
    assert!(skill > 0.99 && ours.test[0].r.unwrap() > 0.999);
}

#[test]
fn perfect_predictions_make_closed_and_open_loop_equal() {
    for horizon in [1, 3] {
        let series = delayed(400, horizon);
        let layout = layout(&[0], &[0, 1], horizon);
        let split = blocks(&series, &layout);
        let mut recipe = recipe(layout, &[]);
        recipe.settings.min_gradient = 0.0;
        let narx = fit(&series, &split, &recipe).unwrap().narx;
        let (start, steps) = (250, 100);
        let closed = narx.free_run(&series, 0, start, steps).unwrap();
        let window = |target| Window { run: 0, present: target - horizon, target };
        let in_question: Vec<Window> = (start..start + steps).map(window).collect();
        let open = narx.predict(&series, &in_question).unwrap();
        let truth = targets(&series, &in_question);
        let worst = |a: &[f64], b: &[f64]| a.iter().zip(b).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
        eprintln!(
            "horizon {horizon}: closed - open {:.1e}, open - truth {:.1e}",
            worst(&closed, &open),
            worst(&open, &truth)
        );
        assert!(closed.len() == steps && worst(&closed, &open) < 1.0e-8 && worst(&open, &truth) < 1.0e-9);
        let hold = score(&truth, &persistence(&series, &in_question), 1, None).unwrap()[0];
        assert!(hold.max > 0.1, "there was something to predict");
    }
}

/// A model with irregular lags and horizon 3; its training need not converge, because the tests accept any function.
fn rough_model(series: &Series, planned: bool) -> Narx {
    let mut layout = layout(&[0, 2, 5], &[0, 1, 7], 3);
    layout.input_at_target = planned;
    let mut recipe = recipe(layout, &[6, 4]);
    recipe.settings.epochs = 4;
    fit(series, &blocks(series, &recipe.layout), &recipe).unwrap().narx
}

#[test]
fn streaming_equals_batch_bit_for_bit() {
    let series = narendra_series(200);
    for planned in [false, true] {
        let narx = rough_model(&series, planned);
        let all = windows(&series, 7, 3).unwrap();
        let batch = narx.predict(&series, &all).unwrap();
        let mut predictor = Predictor::new(narx);
        let mut streamed = Vec::new();
        for run in 0..2 {
            predictor.reset();
            for k in 0..197 {
                let (u, y) = (series.input(run, k), Some(series.output(run, k)));
                let prediction = if planned {
                    predictor.push_planned(u, series.input(run, k + 3), y)
                } else {
                    predictor.push(u, y)
                };
                streamed.extend(prediction.unwrap().into_iter().flatten().copied());
            }
        }
        assert_eq!(streamed.len(), 2 * (200 - 10) * 2);
        assert_eq!(streamed, batch);
    }
}

#[test]
fn closed_loop_equals_open_loop_on_a_series_of_own_predictions() {
    let series = narendra_series(200);
    let narx = rough_model(&series, false);
    let (start, steps) = (60, 40);
    let closed = narx.free_run(&series, 1, start, steps).unwrap();
    // The same by hand: the test writes each prediction into a copy of the series before it makes the next one.
    let inputs: Vec<f64> = (0..200).flat_map(|k| series.input(1, k)).copied().collect();
    let mut outputs: Vec<f64> = (0..200).flat_map(|k| series.output(1, k)).copied().collect();
    outputs[2 * start..].fill(0.0);
    for target in start..start + steps {
        let mut copy = Series::new(&["u", "constant"], &["y", "z"]).unwrap();
        copy.push_run("copy", inputs.clone(), outputs.clone()).unwrap();
        let next = narx.predict(&copy, &[Window { run: 0, present: target - 3, target }]).unwrap();
        outputs[2 * target..2 * target + 2].copy_from_slice(&next);
    }
    let by_hand = &outputs[2 * start..2 * (start + steps)];
    let worst = closed.iter().zip(by_hand).fold(0.0_f64, |m, (a, b)| m.max((a - b).abs()));
    let open = narx.predict(&series, &[Window { run: 1, present: 87, target: 90 }]).unwrap();
    eprintln!("largest difference {worst:.1e}; open loop {:.3}, closed {:.3}", open[0], closed[60]);
    assert!(worst < 1.0e-12);
    assert!((open[0] - closed[60]).abs() > 1.0e-3, "the loops really differ");
}

#[test]
fn without_measured_outputs_the_start_value_is_used_until_there_is_a_prediction() {
    let series = narendra_series(200);
    let mut blind = Predictor::new(rough_model(&series, false));
    let mut told = blind.clone();
    blind.start_from(&[0.7, 2.0e-4]).unwrap();
    let mut kept = Vec::new();
    for k in 0..30 {
        // The first prediction, made at sample 7, is for sample 10.
        let known: Vec<f64> = if k < 10 { vec![0.7, 2.0e-4] } else { kept[2 * (k - 10)..][..2].to_vec() };
        let a = blind.push(series.input(0, k), None).unwrap().map(<[f64]>::to_vec);
        let b = told.push(series.input(0, k), Some(&known)).unwrap().map(<[f64]>::to_vec);
        assert_eq!(a.is_some(), k >= 7);
        for (a, b) in a.iter().flatten().zip(b.iter().flatten()) {
            assert!((a - b).abs() < 1.0e-12, "sample {k}: {a} {b}");
        }
        kept.extend(a.into_iter().flatten());
    }
    assert!((kept[0] - kept[40]).abs() > 1.0e-3, "the prediction moves");
}

#[test]
fn pushing_allocates_nothing() {
    let series = narendra_series(200);
    let mut predictor = Predictor::new(rough_model(&series, false));
    let mut sum = 0.0;
    let counted = allocation_counter::measure(|| {
        for k in 0..200 {
            let measured = (k < 100).then(|| series.output(0, k));
            let prediction = predictor.push(series.input(0, k), measured);
            sum += prediction.unwrap().map_or(0.0, |y| y[0]);
        }
    });
    assert!(sum != 0.0);
    assert_eq!(counted.count_total, 0);
}

#[test]
fn bad_samples_are_refused_and_leave_the_predictor_as_it_was() {
    let series = narendra_series(200);
    let mut predictor = Predictor::new(rough_model(&series, false));
    for k in 0..20 {
        predictor.push(series.input(0, k), Some(series.output(0, k))).unwrap();
    }
    let mut untouched = predictor.clone();
    let (u, y) = (series.input(0, 20), series.output(0, 20));
    let nan = [0.0, f64::NAN];
    let refused = [
        predictor.push(&u[..1], Some(y)).unwrap_err(),
        predictor.push(&nan, Some(y)).unwrap_err(),
        predictor.push(u, Some(&[f64::INFINITY, 0.0])).unwrap_err(),
        predictor.push(u, Some(&[0.0; 3])).unwrap_err(),
        predictor.push_planned(u, u, Some(y)).unwrap_err(),
        predictor.start_from(&nan).unwrap_err(),
    ];
    assert!(matches!(refused[0], PushError::WrongLength { kind: "input", given: 1, channels: 2 }));
    assert!(matches!(refused[1], PushError::NonFinite { kind: "input", channel: 1, .. }));
    assert!(matches!(refused[2], PushError::NonFinite { kind: "output", channel: 0, .. }));
    assert!(matches!(refused[3], PushError::WrongLength { kind: "output", .. }));
    assert!(matches!(refused[4], PushError::Planned { used: false, given: true }));
    assert!(matches!(refused[5], PushError::NonFinite { .. }));
    assert_eq!(predictor.push(u, Some(y)).unwrap(), untouched.push(u, Some(y)).unwrap());
    let mut planned = Predictor::new(rough_model(&series, true));
    assert!(matches!(planned.push(u, Some(y)), Err(PushError::Planned { used: true, given: false })));
}

#[test]
fn the_same_arguments_train_the_same_model() {
    let series = narendra_series(300);
    let layout = layout(&[0], &[0, 1], 1);
    let split = blocks(&series, &layout);
    let weights = |seed| {
        let mut recipe = recipe(layout.clone(), &[5]);
        (recipe.seed, recipe.settings.epochs) = (seed, 10);
        fit(&series, &split, &recipe).unwrap().outcome.weights
    };
    let first = weights(1);
    assert_eq!(first, weights(1));
    assert_ne!(first, weights(2));
}

#[test]
fn the_papers_four_layers_train_on_sigmoids() {
    let series = narendra_series(400);
    let layout = Layout { input_at_target: true, ..layout(&[0, 1], &[0, 1], 1) };
    let split = blocks(&series, &layout);
    let mut recipe = recipe(layout, &[10; 4]);
    (recipe.activation, recipe.settings.epochs) = (Activation::Logistic, 40);
    let Trained { narx, outcome } = fit(&series, &split, &recipe).unwrap();
    assert_eq!(narx.network().sizes(), [10, 10, 10, 10, 10, 2]);
    let (first, best) = (&outcome.history[0], &outcome.history[outcome.best_epoch]);
    eprintln!("mse {:.2e} -> {:.2e}, {:?}", first.mse, best.mse, outcome.stop);
    assert!(best.validation_mse.unwrap() < 0.1 * first.validation_mse.unwrap());
}

#[test]
fn bad_training_input_is_named() {
    let series = narendra_series(100);
    let layout = layout(&[0], &[0, 1], 1);
    let split = blocks(&series, &layout);
    let message = |series: &Series, split: &Split, recipe: &Recipe| fit(series, split, recipe).unwrap_err();
    let large = message(&series, &split, &recipe(layout.clone(), &[20, 20]));
    assert_eq!(large, TrainError::TooFewSamples { windows: 98, outputs: 2, weights: 602, needed: 301 });
    assert!(large.to_string().contains("at least 301"), "{large}");
    let none = Split { train: vec![], ..split.clone() };
    assert!(matches!(
        message(&series, &none, &recipe(layout.clone(), &[])),
        TrainError::TooFewSamples { .. }
    ));
    let empty_layer = message(&series, &split, &recipe(layout.clone(), &[3, 0]));
    assert!(matches!(empty_layer, TrainError::Network(_)));
    let longer = Layout { output_lags: vec![0, 5], ..layout.clone() };
    let outside = message(&series, &split, &recipe(longer, &[3]));
    assert!(matches!(outside, TrainError::Window(WindowError::Outside { .. })), "{outside}");
    let mut flat = Series::new(&["u"], &["y", "still"]).unwrap();
    let (u, y) = narendra(100, 1);
    flat.push_run("flat", u, y.iter().flat_map(|y| [*y, 0.6]).collect()).unwrap();
    let constant = message(&flat, &blocks(&flat, &layout), &recipe(layout, &[3]));
    assert_eq!(constant, TrainError::ConstantOutput { channel: "still".into(), value: 0.6 });
}

#[test]
fn bad_prediction_input_is_named() {
    let series = narendra_series(200);
    let narx = rough_model(&series, false);
    let other = Series::new(&["u"], &["y", "z"]).unwrap();
    assert!(matches!(narx.predict(&other, &[]), Err(PredictError::Channels(_))));
    let attempt = |run, present, target| {
        matches!(narx.predict(&series, &[Window { run, present, target }]), Err(PredictError::Window(_)))
    };
    assert!(attempt(0, 6, 9) && attempt(0, 20, 22) && attempt(0, 197, 200) && attempt(2, 20, 23));
    for (start, steps) in [(9, 5), (150, 51), (2, 1), (150, usize::MAX)] {
        assert!(matches!(narx.free_run(&series, 0, start, steps), Err(PredictError::Window(_))));
    }
    assert_eq!(narx.free_run(&series, 0, 10, 190).unwrap().len(), 380);
}

#[test]
fn training_can_be_watched_and_interrupted() {
    let series = narendra_series(200);
    let layout = layout(&[0], &[0, 1], 1);
    let split = blocks(&series, &layout);
    let mut epochs = Vec::new();
    let trained = train(&series, &split, &recipe(layout, &[4]), Provenance::default(), |epoch| {
        epochs.push(epoch.epoch);
        if epochs.len() == 3 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    assert_eq!(epochs, [0, 1, 2]);
    assert_eq!(trained.unwrap().outcome.stop, Stop::Interrupted);
}

/// The test covers one hidden layer, several, and none, in which case the first layer is also the last.
#[test]
fn the_network_in_physical_units_says_what_the_model_says() {
    let series = narendra_series(200);
    let layout = Layout { input_lags: vec![], output_lags: vec![], horizon: 1, input_at_target: true };
    let all = windows(&series, layout.memory(), layout.horizon).unwrap();
    for hidden in [&[5][..], &[4, 3], &[]] {
        let split = by_block(&all, Fractions::PAPER, layout.memory() + layout.horizon).unwrap();
        let recipe = Recipe { layout: layout.clone(), ..recipe(layout.clone(), hidden) };
        let narx = fit(&series, &split, &recipe).unwrap().narx;
        let network = narx.in_physical_units().unwrap();
        let mut scratch = network.scratch();
        let (mut worst, mut greatest) = (0.0_f64, 0.0_f64);
        for (window, expected) in all.iter().zip(narx.predict(&series, &all).unwrap().chunks_exact(2)) {
            let said = network.forward(series.input(window.run, window.target), &mut scratch);
            worst = said.iter().zip(expected).fold(worst, |worst, (a, b)| worst.max((a - b).abs()));
            greatest = expected.iter().fold(greatest, |greatest, value| greatest.max(value.abs()));
        }
        println!("{hidden:?}: off by {worst:.1e} of {greatest:.1e}");
        assert!(greatest > 0.01 && worst < 1e-12 * greatest);
    }
}

/// The output of a widened model must not depend on the values of the added channels.
#[test]
fn a_widened_model_looks_at_its_own_channels_alone() {
    let series = narendra_series(200);
    let layout = layout(&[0, 1], &[0], 1);
    let split = blocks(&series, &layout);
    let narx = fit(&series, &split, &recipe(layout.clone(), &[4])).unwrap().narx;
    let names = ["a", "u", "b", "constant"].map(str::to_owned);
    let wide = narx.widened(&names, &[1, 3]).unwrap();
    assert_eq!((wide.input_names(), wide.network().inputs()), (&names[..], 2 * 4 + 2));
    let mut widened = Series::new(&["a", "u", "b", "constant"], &["y", "z"]).unwrap();
    for (index, run) in series.runs().iter().enumerate() {
        let rows = 0..run.samples();
        let inputs = rows.clone().flat_map(|k| {
            let [u, constant] = [series.input(index, k)[0], series.input(index, k)[1]];
            [7.0 * k as f64, u, -1e3, constant]
        });
        let outputs = rows.clone().flat_map(|k| series.output(index, k).to_vec());
        widened.push_run("wide", inputs.collect(), outputs.collect()).unwrap();
    }
    let all = windows(&series, layout.memory(), 1).unwrap();
    let (narrow, wide_said) = (narx.predict(&series, &all).unwrap(), wide.predict(&widened, &all).unwrap());
    let spread = narrow.iter().fold((f64::MAX, f64::MIN), |(l, h), x| (l.min(*x), h.max(*x)));
    assert!(spread.1 - spread.0 > 0.5, "the model says something");
    assert!(narrow.iter().zip(&wide_said).all(|(a, b)| (a - b).abs() < 1e-12));
    assert!(narx.widened(&names, &[1, 4]).is_err() && narx.widened(&names, &[1]).is_err());
}

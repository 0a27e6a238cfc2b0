//! Time series: named channels, and evenly sampled runs of them.

/// Reasons why a [`Series`] refuses samples.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum SeriesError {
    /// There is no output channel.
    #[error("no output channel: name at least one")]
    NoOutputs,
    /// Two channels share a name.
    #[error("channel `{name}` is named twice: every channel needs its own name")]
    DuplicateChannel {
        /// The name.
        name: String,
    },
    /// The number of a run's values is not a multiple of the number of channels.
    #[error("run `{run}`: {values} {kind} values don't divide into samples of {channels} channels")]
    Ragged {
        /// Name of the run.
        run: String,
        /// `input` or `output`.
        kind: &'static str,
        /// Number of given values.
        values: usize,
        /// Number of channels of that kind.
        channels: usize,
    },
    /// Inputs and outputs have different lengths.
    #[error("run `{run}`: {inputs} input samples but {outputs} output samples; give both for every instant")]
    LengthMismatch {
        /// Name of the run.
        run: String,
        /// Number of input samples.
        inputs: usize,
        /// Number of output samples.
        outputs: usize,
    },
    /// A sample is NaN or infinite.
    #[error(
        "run `{run}`, sample {sample}, channel `{channel}`: {value} is not a finite number; cut it out or repair it"
    )]
    NonFinite {
        /// Name of the run.
        run: String,
        /// Index of the sample, from 0.
        sample: usize,
        /// Name of the channel.
        channel: String,
        /// The value found.
        value: f64,
    },
    /// Two series, or a series and a model, have different channels.
    #[error("the {kind} channels are {found:?}, expected {expected:?}, in this order")]
    OtherChannels {
        /// `input` or `output`.
        kind: &'static str,
        /// Expected channels.
        expected: Vec<String>,
        /// Found channels.
        found: Vec<String>,
    },
}

/// One evenly sampled recording of all channels. [`Series::push_run`] creates it, so all its values are finite.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    name: String,
    samples: usize,
    inputs: Vec<f64>,
    outputs: Vec<f64>,
}

/// Named channels and runs of them. A window never spans two runs.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    input_names: Vec<String>,
    output_names: Vec<String>,
    runs: Vec<Run>,
}

impl Run {
    /// Name of the run, for messages.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Number of samples.
    #[must_use]
    pub fn samples(&self) -> usize {
        self.samples
    }
}

impl Series {
    /// Creates an empty series of these channels. It may have no inputs, but needs an output.
    ///
    /// # Errors
    /// If there is no output, or a name appears twice.
    pub fn new(input_names: &[&str], output_names: &[&str]) -> Result<Self, SeriesError> {
        if output_names.is_empty() {
            return Err(SeriesError::NoOutputs);
        }
        let all: Vec<&str> = input_names.iter().chain(output_names).copied().collect();
        if let Some(i) = (1..all.len()).find(|&i| all[..i].contains(&all[i])) {
            return Err(SeriesError::DuplicateChannel { name: all[i].to_owned() });
        }
        let owned = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect();
        Ok(Self { input_names: owned(input_names), output_names: owned(output_names), runs: Vec::new() })
    }

    /// Adds a run. `inputs` and `outputs` are row-major: all channels of sample 0, then of sample 1, and so on.
    ///
    /// # Errors
    /// If the values do not form whole samples, inputs and outputs differ in length, or a value is not finite (the error names
    /// run, sample and channel). The series is then unchanged.
    pub fn push_run(&mut self, name: &str, inputs: Vec<f64>, outputs: Vec<f64>) -> Result<(), SeriesError> {
        let samples = outputs.len() / self.outputs();
        let ragged = |kind, values: &[f64], channels| SeriesError::Ragged {
            run: name.to_owned(),
            kind,
            values: values.len(),
            channels,
        };
        if !outputs.len().is_multiple_of(self.outputs()) {
            return Err(ragged("output", &outputs, self.outputs()));
        }
        if inputs.len().checked_rem(self.inputs()).unwrap_or(inputs.len()) != 0 {
            return Err(ragged("input", &inputs, self.inputs()));
        }
        if let Some(found) = inputs.len().checked_div(self.inputs()).filter(|&n| n != samples) {
            return Err(SeriesError::LengthMismatch {
                run: name.to_owned(),
                inputs: found,
                outputs: samples,
            });
        }
        check_finite(name, &self.input_names, &inputs)?;
        check_finite(name, &self.output_names, &outputs)?;
        self.runs.push(Run { name: name.to_owned(), samples, inputs, outputs });
        Ok(())
    }

    /// Checks that this series has exactly these channels, in this order.
    ///
    /// # Errors
    /// If the channels differ; the message contains both lists.
    pub fn check_channels(&self, inputs: &[String], outputs: &[String]) -> Result<(), SeriesError> {
        for (kind, expected, found) in
            [("input", inputs, &self.input_names), ("output", outputs, &self.output_names)]
        {
            if expected != found {
                let (expected, found) = (expected.to_vec(), found.clone());
                return Err(SeriesError::OtherChannels { kind, expected, found });
            }
        }
        Ok(())
    }

    /// Names of the input channels.
    #[must_use]
    pub fn input_names(&self) -> &[String] {
        &self.input_names
    }

    /// Names of the output channels.
    #[must_use]
    pub fn output_names(&self) -> &[String] {
        &self.output_names
    }

    /// Number of input channels.
    #[must_use]
    pub fn inputs(&self) -> usize {
        self.input_names.len()
    }

    /// Number of output channels.
    #[must_use]
    pub fn outputs(&self) -> usize {
        self.output_names.len()
    }

    /// The runs, in the order in which they were added.
    #[must_use]
    pub fn runs(&self) -> &[Run] {
        &self.runs
    }

    /// All input channels of one sample.
    #[must_use]
    pub fn input(&self, run: usize, sample: usize) -> &[f64] {
        &self.runs[run].inputs[sample * self.inputs()..][..self.inputs()]
    }

    /// All output channels of one sample.
    #[must_use]
    pub fn output(&self, run: usize, sample: usize) -> &[f64] {
        &self.runs[run].outputs[sample * self.outputs()..][..self.outputs()]
    }
}

fn check_finite(run: &str, names: &[String], values: &[f64]) -> Result<(), SeriesError> {
    match values.iter().enumerate().find(|(_, value)| !value.is_finite()) {
        None => Ok(()),
        Some((at, &value)) => Err(SeriesError::NonFinite {
            run: run.to_owned(),
            sample: at / names.len(),
            channel: names[at % names.len()].clone(),
            value,
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_come_back_where_they_were_put() {
        let mut series = Series::new(&["a", "b"], &["y"]).unwrap();
        series.push_run("one", vec![1.0, 2.0, 3.0, 4.0], vec![5.0, 6.0]).unwrap();
        series.push_run("two", vec![7.0, 8.0], vec![9.0]).unwrap();
        assert_eq!(series.input(0, 1), [3.0, 4.0]);
        assert_eq!(series.output(1, 0), [9.0]);
        assert_eq!(series.runs()[0].samples(), 2);
    }

    #[test]
    fn a_series_without_inputs_is_allowed() {
        let mut series = Series::new(&[], &["y"]).unwrap();
        series.push_run("one", vec![], vec![5.0, 6.0]).unwrap();
        assert_eq!(series.input(0, 1), [0.0; 0]);
        let stray = series.push_run("two", vec![1.0], vec![5.0]).unwrap_err();
        assert!(matches!(stray, SeriesError::Ragged { kind: "input", .. }));
    }

    #[test]
    fn bad_samples_are_named() {
        assert_eq!(Series::new(&["a"], &[]), Err(SeriesError::NoOutputs));
        let twice = Series::new(&["a"], &["a"]).unwrap_err();
        assert_eq!(twice, SeriesError::DuplicateChannel { name: "a".into() });
        let mut series = Series::new(&["a", "b"], &["x", "y"]).unwrap();
        let mut push = |inputs: Vec<f64>, outputs: Vec<f64>| {
            series.push_run("sharp", inputs, outputs).unwrap_err().to_string()
        };
        let nan = push(vec![0.0; 4], vec![0.0, 0.0, 0.0, f64::NAN]);
        assert!(nan.contains("run `sharp`, sample 1, channel `y`: NaN"), "{nan}");
        let infinite = push(vec![f64::INFINITY, 0.0], vec![0.0, 0.0]);
        assert!(infinite.contains("sample 0, channel `a`: inf"), "{infinite}");
        assert!(push(vec![0.0; 3], vec![0.0; 2]).contains("3 input values"));
        assert!(push(vec![0.0; 2], vec![0.0; 3]).contains("3 output values"));
        assert!(push(vec![0.0; 4], vec![0.0; 2]).contains("2 input samples but 1 output"));
        assert!(series.runs().is_empty());
        let other = series.check_channels(&["a".into()], &["x".into(), "y".into()]).unwrap_err();
        assert!(matches!(other, SeriesError::OtherChannels { kind: "input", .. }));
    }
}

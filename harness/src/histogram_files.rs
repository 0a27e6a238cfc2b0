//! Latency histograms as files: `.hlog` for HdrHistogram's tools, `.hgrm` for its plotters and for people.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;
use std::time::{Duration, SystemTime};

use freeplay_plant::{Stage, Stages};
use freeplay_terminal::exit::Failure;
use freeplay_terminal::files::write;
use hdrhistogram::Histogram;
use hdrhistogram::serialization::interval_log::{
    IntervalLogIterator, IntervalLogWriterBuilder, LogEntry, Tag,
};
use hdrhistogram::serialization::{Deserializer, V2DeflateSerializer};

/// Divisor from nanoseconds to the microseconds in the files.
const UNIT: f64 = 1e3;

/// Writes the histograms of a run of `duration` that began at `start` as one interval log with one tag a stage; values in ns,
/// maxima in µs.
///
/// # Errors
/// An unwritable file.
pub fn write_hlog(
    path: &Path,
    stages: &Stages,
    start: SystemTime,
    duration: Duration,
) -> Result<(), Failure> {
    let all = Stage::ALL.map(|stage| (stage.name(), stages.histogram(stage)));
    write_log(path, &all, start, duration)
}

/// Writes histograms (ns) by tag, without a time, as one interval log.
///
/// # Errors
/// An unwritable file.
pub fn write_tagged(path: &Path, histograms: &BTreeMap<String, Histogram<u64>>) -> Result<(), Failure> {
    let all: Vec<(&str, &Histogram<u64>)> =
        histograms.iter().map(|(tag, histogram)| (tag.as_str(), histogram)).collect();
    write_log(path, &all, SystemTime::now(), Duration::ZERO)
}

fn write_log(
    path: &Path,
    histograms: &[(&str, &Histogram<u64>)],
    start: SystemTime,
    duration: Duration,
) -> Result<(), Failure> {
    let mut text = Vec::new();
    let mut serializer = V2DeflateSerializer::new();
    let mut log = IntervalLogWriterBuilder::new()
        .add_comment("Freeplay latencies by stage, ns; the maximum of a line in us")
        .with_start_time(start)
        .with_base_time(start)
        .with_max_value_divisor(UNIT)
        .begin_log_with(&mut text, &mut serializer)
        .map_err(Failure::internal)?;
    for (tag, histogram) in histograms.iter().filter(|(_, histogram)| !histogram.is_empty()) {
        log.write_histogram(histogram, Duration::ZERO, duration, Tag::new(tag))
            .map_err(|error| Failure::internal(format!("{error:?}")))?;
    }
    drop(log);
    write(path, &String::from_utf8(text).map_err(Failure::internal)?)
}

/// Writes the percentile distribution of every stage, µs: the round trip as `NAME.hgrm`, each other stage as `NAME.STAGE.hgrm`,
/// because a plotter reads one distribution a file.
///
/// # Errors
/// An unwritable file.
pub fn write_hgrm(folder: &Path, name: &str, stages: &Stages) -> Result<(), Failure> {
    for stage in Stage::ALL {
        let histogram = stages.histogram(stage);
        if histogram.is_empty() {
            continue;
        }
        let mut text = String::new();
        distribution(&mut text, histogram).map_err(Failure::internal)?;
        let file = match stage {
            Stage::RoundTrip => format!("{name}.hgrm"),
            _ => format!("{name}.{}.hgrm", stage.name()),
        };
        write(&folder.join(file), &text)?;
    }
    Ok(())
}

/// Writes the percentile distribution of `histogram` (ns), µs.
///
/// # Errors
/// An unwritable file.
pub fn write_distribution(path: &Path, histogram: &Histogram<u64>) -> Result<(), Failure> {
    let mut text = String::new();
    distribution(&mut text, histogram).map_err(Failure::internal)?;
    write(path, &text)
}

fn distribution(text: &mut String, histogram: &Histogram<u64>) -> std::fmt::Result {
    writeln!(text, "{:>12} {:>14} {:>10} {:>14}\n", "Value", "Percentile", "TotalCount", "1/(1-Percentile)")?;
    let mut count = 0;
    for step in histogram.iter_quantiles(5) {
        let quantile = step.quantile_iterated_to();
        let value = step.value_iterated_to() as f64 / UNIT;
        count += step.count_since_last_iteration();
        if quantile < 1.0 {
            writeln!(text, "{value:>12.3} {quantile:>14.12} {count:>10} {:>14.2}", 1.0 / (1.0 - quantile))?;
        } else {
            writeln!(text, "{value:>12.3} {quantile:>14.12} {count:>10}")?;
        }
    }
    let (mean, deviation) = (histogram.mean() / UNIT, histogram.stdev() / UNIT);
    writeln!(text, "#[Mean    = {mean:>12.3}, StdDeviation   = {deviation:>12.3}]")?;
    writeln!(
        text,
        "#[Max     = {:>12.3}, Total count    = {:>12}]",
        histogram.max() as f64 / UNIT,
        histogram.len()
    )?;
    writeln!(
        text,
        "#[Buckets = {:>12}, SubBuckets     = {:>12}]\n",
        histogram.buckets(),
        histogram.distinct_values()
    )
}

/// Reads an interval log: the histogram (ns) of each tag.
///
/// # Errors
/// An unreadable file, or one that is not an interval log.
pub fn read_hlog(path: &Path) -> Result<Vec<(String, Histogram<u64>)>, Failure> {
    let fault = |what: String| Failure::input(format!("{}: {what}", path.display()));
    let text = freeplay_storage::read_bytes(path, freeplay_storage::DOCUMENT_LIMIT)?;
    let mut deserializer = Deserializer::new();
    let mut found = Vec::new();
    for entry in IntervalLogIterator::new(&text) {
        let LogEntry::Interval(interval) = entry.map_err(|error| fault(format!("{error:?}")))? else {
            continue;
        };
        let encoded =
            base64::Engine::decode(&base64::engine::general_purpose::STANDARD, interval.encoded_histogram());
        let bytes = encoded.map_err(|error| fault(error.to_string()))?;
        let histogram =
            deserializer.deserialize(&mut bytes.as_slice()).map_err(|error| fault(format!("{error:?}")))?;
        found.push((interval.tag().map_or(String::new(), |tag| tag.as_str().to_owned()), histogram));
    }
    Ok(found)
}

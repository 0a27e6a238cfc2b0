//! Recordings: MCAP and CSV, read and written with one set of column names.

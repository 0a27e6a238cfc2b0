//! NARX network, Levenberg-Marquardt training, data windows and baselines.

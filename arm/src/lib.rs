//! The rigid arm: model, kinematics and dynamics of a serial chain.

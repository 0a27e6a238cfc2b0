//! What a faulty controller, plant or signal does to a run of the real binary.

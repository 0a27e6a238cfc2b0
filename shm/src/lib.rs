//! What crosses the process boundary: messages, links over iceoryx2, handshake, pacing.

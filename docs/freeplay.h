/* The messages of Freeplay, layout version 1; messages.md beside this file says what they mean.
   Made by `cargo run -p freeplay-shm --example layout`. */
#ifndef FREEPLAY_H
#define FREEPLAY_H

#include <assert.h>
#include <stddef.h>
#include <stdint.h>

#define FREEPLAY_LAYOUT_VERSION 1u
#define FREEPLAY_MAX_JOINTS 12
#define FREEPLAY_MAGIC "FREEPLAY" /* the eight bytes of the field magic */
#define FREEPLAY_IN_CHARGE_SHIFT 8
#define FREEPLAY_NEXT_SHIFT 12
#define FREEPLAY_SLOT_MASK 0xfu

/* State.mode, Welcome.mode */
enum {
    FREEPLAY_MODE_TORQUE = 0,
    FREEPLAY_MODE_DRIVEN = 1,
    FREEPLAY_MODE_SERVO = 2,
};

/* Welcome.pace */
enum {
    FREEPLAY_PACE_LOCKSTEP = 0,
    FREEPLAY_PACE_REALTIME = 1,
};

/* Command.kind */
enum {
    FREEPLAY_COMMAND_KIND_TORQUE = 0,
    FREEPLAY_COMMAND_KIND_POSITION = 1,
};

/* Command.status */
enum {
    FREEPLAY_COMMAND_STATUS_OK = 0,
    FREEPLAY_COMMAND_STATUS_QP_FAILED = 1,
    FREEPLAY_COMMAND_STATUS_QP_LIMIT = 2,
    FREEPLAY_COMMAND_STATUS_NO_ANSWER = 3,
};

/* Welcome.verdict */
enum {
    FREEPLAY_VERDICT_ACCEPTED = 0,
    FREEPLAY_VERDICT_WRONG_MAGIC = 1,
    FREEPLAY_VERDICT_WRONG_LAYOUT = 2,
    FREEPLAY_VERDICT_WRONG_JOINTS = 3,
    FREEPLAY_VERDICT_SLOT_TAKEN = 4,
    FREEPLAY_VERDICT_WRONG_RUN = 5,
    FREEPLAY_VERDICT_NO_SUCH_SLOT = 6,
};

/* State.flags (bits; those of the slots are below) */
enum {
    FREEPLAY_FLAG_LAST = 1,
    FREEPLAY_FLAG_TOOL_TRACKED = 2,
    FREEPLAY_FLAG_FALLBACK = 4,
};

/* iceoryx2 knows these types by the names freeplay.State, freeplay.Command, freeplay.Hello, freeplay.Welcome. */

/* Where the arm should be at one instant; part of State. */
typedef struct {
    double q[12]; /* Desired joint positions. [rad (m)] */
    double qd[12]; /* Desired joint velocities. [rad/s (m/s)] */
    double qdd[12]; /* Desired joint accelerations. [rad/s² (m/s²)] */
} freeplay_reference;
static_assert(sizeof(freeplay_reference) == 288, "size of freeplay_reference");
static_assert(offsetof(freeplay_reference, q) == 0, "offset of freeplay_reference.q");
static_assert(offsetof(freeplay_reference, qd) == 96, "offset of freeplay_reference.qd");
static_assert(offsetof(freeplay_reference, qdd) == 192, "offset of freeplay_reference.qdd");

/* The arm at one tick, from the plant to everyone who listens. */
typedef struct {
    uint64_t magic; /* The eight ASCII letters FREEPLAY. */
    uint32_t layout; /* Layout version of the sender. */
    uint32_t joints; /* Number of joints in use, 1 to 12. [1] */
    uint64_t run; /* Hash of the run's id: FNV-1a, 64 bit. */
    uint64_t tick; /* Tick number, from 0. [1] */
    uint64_t scheduled_ns; /* Time of tick k on the schedule: CLOCK_MONOTONIC in real time, simulated time from 0 in lockstep. [ns] */
    uint64_t published_ns; /* When the plant published this state, CLOCK_MONOTONIC. [ns] */
    uint32_t mode; /* Code of Mode. */
    uint32_t flags; /* Sum of the flags that hold. */
    double q[12]; /* Measured joint positions. [rad (m)] */
    double qd[12]; /* Measured joint velocities. [rad/s (m/s)] */
    double tau[12]; /* Measured joint torques (forces). [N·m (N)] */
    double applied[12]; /* The command in force during this tick, after the gate. [as Command.value] */
    freeplay_reference reference; /* Reference at tick k. */
    freeplay_reference reference_next; /* Reference at the instant that the answer to this state is for: in modes torque and servo the start of tick k + 1, in mode driven its end. */
    double tool[7]; /* Measured pose of frame tool0: position and unit quaternion; NaN if not tracked. [m, 1] */
} freeplay_state;
static_assert(sizeof(freeplay_state) == 1072, "size of freeplay_state");
static_assert(offsetof(freeplay_state, magic) == 0, "offset of freeplay_state.magic");
static_assert(offsetof(freeplay_state, layout) == 8, "offset of freeplay_state.layout");
static_assert(offsetof(freeplay_state, joints) == 12, "offset of freeplay_state.joints");
static_assert(offsetof(freeplay_state, run) == 16, "offset of freeplay_state.run");
static_assert(offsetof(freeplay_state, tick) == 24, "offset of freeplay_state.tick");
static_assert(offsetof(freeplay_state, scheduled_ns) == 32, "offset of freeplay_state.scheduled_ns");
static_assert(offsetof(freeplay_state, published_ns) == 40, "offset of freeplay_state.published_ns");
static_assert(offsetof(freeplay_state, mode) == 48, "offset of freeplay_state.mode");
static_assert(offsetof(freeplay_state, flags) == 52, "offset of freeplay_state.flags");
static_assert(offsetof(freeplay_state, q) == 56, "offset of freeplay_state.q");
static_assert(offsetof(freeplay_state, qd) == 152, "offset of freeplay_state.qd");
static_assert(offsetof(freeplay_state, tau) == 248, "offset of freeplay_state.tau");
static_assert(offsetof(freeplay_state, applied) == 344, "offset of freeplay_state.applied");
static_assert(offsetof(freeplay_state, reference) == 440, "offset of freeplay_state.reference");
static_assert(offsetof(freeplay_state, reference_next) == 728, "offset of freeplay_state.reference_next");
static_assert(offsetof(freeplay_state, tool) == 1016, "offset of freeplay_state.tool");

/* The answer of one controller to one State. */
typedef struct {
    uint64_t magic; /* The eight ASCII letters FREEPLAY. */
    uint32_t layout; /* Layout version of the sender. */
    uint32_t joints; /* Number of joints in use, as in the state. [1] */
    uint64_t run; /* Hash of the run's id, as in the state. */
    uint64_t tick; /* Tick of the state this answers. [1] */
    uint32_t slot; /* The slot in which the controller was accepted. [1] */
    uint32_t status; /* Code of CommandStatus. */
    uint64_t received_ns; /* When the controller took the state, CLOCK_MONOTONIC. [ns] */
    uint64_t predict_ns; /* How long the prediction took; 0 if there was none. [ns] */
    uint64_t qp_ns; /* How long the quadratic programme took; 0 if there was none. [ns] */
    uint64_t sent_ns; /* When the controller sent this, CLOCK_MONOTONIC. [ns] */
    uint32_t qp_iterations; /* Iterations of the quadratic programme; 0 if there was none, or no limit binds. [1] */
    uint32_t kind; /* Code of CommandKind: by State.mode. */
    double value[12]; /* Joint torques with kind torque, joint positions with kind position. [N·m (N) or rad (m)] */
    double velocity[12]; /* With kind position; else zero. [rad/s (m/s)] */
    double acceleration[12]; /* With kind position; else zero. [rad/s² (m/s²)] */
    double deviation[3]; /* Predicted deviation of the tool, x y z, before it is taken out; zero if not predicted. [m] */
} freeplay_command;
static_assert(sizeof(freeplay_command) == 392, "size of freeplay_command");
static_assert(offsetof(freeplay_command, magic) == 0, "offset of freeplay_command.magic");
static_assert(offsetof(freeplay_command, layout) == 8, "offset of freeplay_command.layout");
static_assert(offsetof(freeplay_command, joints) == 12, "offset of freeplay_command.joints");
static_assert(offsetof(freeplay_command, run) == 16, "offset of freeplay_command.run");
static_assert(offsetof(freeplay_command, tick) == 24, "offset of freeplay_command.tick");
static_assert(offsetof(freeplay_command, slot) == 32, "offset of freeplay_command.slot");
static_assert(offsetof(freeplay_command, status) == 36, "offset of freeplay_command.status");
static_assert(offsetof(freeplay_command, received_ns) == 40, "offset of freeplay_command.received_ns");
static_assert(offsetof(freeplay_command, predict_ns) == 48, "offset of freeplay_command.predict_ns");
static_assert(offsetof(freeplay_command, qp_ns) == 56, "offset of freeplay_command.qp_ns");
static_assert(offsetof(freeplay_command, sent_ns) == 64, "offset of freeplay_command.sent_ns");
static_assert(offsetof(freeplay_command, qp_iterations) == 72, "offset of freeplay_command.qp_iterations");
static_assert(offsetof(freeplay_command, kind) == 76, "offset of freeplay_command.kind");
static_assert(offsetof(freeplay_command, value) == 80, "offset of freeplay_command.value");
static_assert(offsetof(freeplay_command, velocity) == 176, "offset of freeplay_command.velocity");
static_assert(offsetof(freeplay_command, acceleration) == 272, "offset of freeplay_command.acceleration");
static_assert(offsetof(freeplay_command, deviation) == 368, "offset of freeplay_command.deviation");

/* What a controller says first. */
typedef struct {
    uint64_t magic; /* The eight ASCII letters FREEPLAY. */
    uint32_t layout; /* Layout version of the controller. */
    uint32_t state_size; /* The controller's size of State. [B] */
    uint32_t command_size; /* The controller's size of Command. [B] */
    uint32_t joints; /* Number of joints the controller is made for; 0 takes what comes. [1] */
    uint32_t slot; /* The slot it asks for, from 0. [1] */
    uint32_t claim; /* 1 if it holds the exclusive flock on slot-<slot>.lock in the run's folder; else 0. */
    uint32_t pid; /* Its process id. */
    uint32_t reserved; /* Zero. */
    uint64_t run; /* Hash of the run's id: FNV-1a, 64 bit. */
    uint8_t name[64]; /* Its name for people, UTF-8, zero padded. */
    uint8_t reserved_tail[24]; /* Zero. */
} freeplay_hello;
static_assert(sizeof(freeplay_hello) == 136, "size of freeplay_hello");
static_assert(offsetof(freeplay_hello, magic) == 0, "offset of freeplay_hello.magic");
static_assert(offsetof(freeplay_hello, layout) == 8, "offset of freeplay_hello.layout");
static_assert(offsetof(freeplay_hello, state_size) == 12, "offset of freeplay_hello.state_size");
static_assert(offsetof(freeplay_hello, command_size) == 16, "offset of freeplay_hello.command_size");
static_assert(offsetof(freeplay_hello, joints) == 20, "offset of freeplay_hello.joints");
static_assert(offsetof(freeplay_hello, slot) == 24, "offset of freeplay_hello.slot");
static_assert(offsetof(freeplay_hello, claim) == 28, "offset of freeplay_hello.claim");
static_assert(offsetof(freeplay_hello, pid) == 32, "offset of freeplay_hello.pid");
static_assert(offsetof(freeplay_hello, reserved) == 36, "offset of freeplay_hello.reserved");
static_assert(offsetof(freeplay_hello, run) == 40, "offset of freeplay_hello.run");
static_assert(offsetof(freeplay_hello, name) == 48, "offset of freeplay_hello.name");
static_assert(offsetof(freeplay_hello, reserved_tail) == 112, "offset of freeplay_hello.reserved_tail");

/* What the plant answers. */
typedef struct {
    uint64_t magic; /* The eight ASCII letters FREEPLAY. */
    uint32_t layout; /* Layout version of the plant. */
    uint32_t state_size; /* The plant's size of State. [B] */
    uint32_t command_size; /* The plant's size of Command. [B] */
    uint32_t verdict; /* Code of Verdict. */
    uint32_t joints; /* Number of joints of the arm. [1] */
    uint32_t mode; /* Code of Mode. */
    uint32_t pace; /* Code of Pace. */
    uint32_t slots; /* Number of slots of the run. [1] */
    uint64_t period_ns; /* Time between two ticks. [ns] */
    uint64_t ticks; /* Length of the run. [1] */
    uint64_t run; /* Hash of the run's id. */
    uint8_t task[1024]; /* Path of the controllers' task file, UTF-8, zero padded. */
    uint8_t reserved_tail[48]; /* Zero. */
} freeplay_welcome;
static_assert(sizeof(freeplay_welcome) == 1136, "size of freeplay_welcome");
static_assert(offsetof(freeplay_welcome, magic) == 0, "offset of freeplay_welcome.magic");
static_assert(offsetof(freeplay_welcome, layout) == 8, "offset of freeplay_welcome.layout");
static_assert(offsetof(freeplay_welcome, state_size) == 12, "offset of freeplay_welcome.state_size");
static_assert(offsetof(freeplay_welcome, command_size) == 16, "offset of freeplay_welcome.command_size");
static_assert(offsetof(freeplay_welcome, verdict) == 20, "offset of freeplay_welcome.verdict");
static_assert(offsetof(freeplay_welcome, joints) == 24, "offset of freeplay_welcome.joints");
static_assert(offsetof(freeplay_welcome, mode) == 28, "offset of freeplay_welcome.mode");
static_assert(offsetof(freeplay_welcome, pace) == 32, "offset of freeplay_welcome.pace");
static_assert(offsetof(freeplay_welcome, slots) == 36, "offset of freeplay_welcome.slots");
static_assert(offsetof(freeplay_welcome, period_ns) == 40, "offset of freeplay_welcome.period_ns");
static_assert(offsetof(freeplay_welcome, ticks) == 48, "offset of freeplay_welcome.ticks");
static_assert(offsetof(freeplay_welcome, run) == 56, "offset of freeplay_welcome.run");
static_assert(offsetof(freeplay_welcome, task) == 64, "offset of freeplay_welcome.task");
static_assert(offsetof(freeplay_welcome, reserved_tail) == 1088, "offset of freeplay_welcome.reserved_tail");

#endif

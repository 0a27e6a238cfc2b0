"""SDK for controllers: derive a class from `Controller`, and call `serve`.

    import freeplay

    class Mine(freeplay.Controller):
        name = "mine"

        def start(self, task, run):
            self.n = run.joints

        def answer(self, state):
            return [-10.0 * qd for qd in state.qd[: self.n]]

    if __name__ == "__main__":
        freeplay.serve(Mine())

Make the file executable and run it with `freeplay run --controller ./mine.py`. The same file works with `freeplay swap`,
`freeplay faults` and `freeplay replay`. This module needs Python 3.10 and `pip install iceoryx2==0.10.0`, but no other
module of the package: a copy of this file works alone.

The layout of the messages is that of docs/messages.md. Units are SI: rad, m, s, N·m. The classes, in the order of the
data flow: State and Command (messages), Run and Answer (input and output of a controller), Controller (base class of
your controller), Link (the run in shared memory), Loop and serve (the process).
"""

from __future__ import annotations

import ctypes
import fcntl
import gc
import os
import signal
import sys
import time
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar

if TYPE_CHECKING:
    Doubles = ctypes.Array[ctypes.c_double]

Opened = TypeVar("Opened")

MAX_JOINTS = 12
LAYOUT_VERSION = 1
MAGIC = int.from_bytes(b"FREEPLAY", sys.byteorder)
ICEORYX2 = "0.10.0"

# State.flags.
FLAG_LAST, FLAG_TOOL_TRACKED, FLAG_FALLBACK = 1, 2, 4
IN_CHARGE_SHIFT, NEXT_SHIFT, SLOT_MASK = 8, 12, 0xF

# State.mode and Welcome.mode; Welcome.pace; Command.kind; Command.status.
TORQUE, DRIVEN, SERVO = 0, 1, 2
LOCKSTEP, REALTIME = 0, 1
KIND_TORQUE, KIND_POSITION = 0, 1
OK, QP_FAILED, QP_LIMIT, NO_ANSWER = 0, 1, 2, 3

# Exit codes of a controller's process.
DONE, USAGE, BAD_INPUT, PEER_MISSING, INTERNAL, INTERRUPTED = 0, 2, 3, 5, 70, 130

u32, u64, Joints = ctypes.c_uint32, ctypes.c_uint64, ctypes.c_double * MAX_JOINTS


class Message(ctypes.Structure):
    """Base class of messages, with the type name for iceoryx2."""

    @classmethod
    def type_name(cls) -> str:
        return f"freeplay.{cls.__name__}"


class Reference(Message):
    """Reference for one tick: positions, velocities and accelerations of the joints."""

    q: Doubles
    qd: Doubles
    qdd: Doubles

    _fields_ = [("q", Joints), ("qd", Joints), ("qdd", Joints)]


class State(Message):
    """State of the arm at one tick, from the plant. The answer takes effect in the next tick."""

    magic: int
    layout: int
    joints: int
    run: int
    tick: int
    scheduled_ns: int
    published_ns: int
    mode: int
    flags: int
    q: Doubles
    qd: Doubles
    tau: Doubles
    applied: Doubles
    reference: Reference
    reference_next: Reference
    tool: Doubles

    _fields_ = [
        ("magic", u64), ("layout", u32), ("joints", u32), ("run", u64), ("tick", u64),
        ("scheduled_ns", u64), ("published_ns", u64), ("mode", u32), ("flags", u32),
        ("q", Joints), ("qd", Joints), ("tau", Joints), ("applied", Joints),
        ("reference", Reference), ("reference_next", Reference), ("tool", ctypes.c_double * 7),
    ]  # fmt: skip

    def has(self, flag: int) -> bool:
        """Returns True if `flag`, one of FLAG_…, is set."""
        return self.flags & flag == flag

    @property
    def in_charge(self) -> int:
        """Slot of the active controller, whose command is in force during this tick."""
        return self.flags >> IN_CHARGE_SHIFT & SLOT_MASK

    @property
    def next_in_charge(self) -> int:
        """Slot of the controller whose answer to this state takes effect in the next tick."""
        return self.flags >> NEXT_SHIFT & SLOT_MASK


class Command(Message):
    """Answer of one controller to one state, for the plant."""

    joints: int
    run: int
    tick: int
    status: int
    received_ns: int
    predict_ns: int
    qp_ns: int
    sent_ns: int
    qp_iterations: int
    kind: int
    value: Doubles
    velocity: Doubles
    acceleration: Doubles
    deviation: Doubles

    _fields_ = [
        ("magic", u64), ("layout", u32), ("joints", u32), ("run", u64), ("tick", u64),
        ("slot", u32), ("status", u32), ("received_ns", u64), ("predict_ns", u64), ("qp_ns", u64), ("sent_ns", u64),
        ("qp_iterations", u32), ("kind", u32), ("value", Joints), ("velocity", Joints), ("acceleration", Joints),
        ("deviation", ctypes.c_double * 3),
    ]  # fmt: skip


class Hello(Message):
    """First message of a controller. Its layout never changes."""

    _fields_ = [
        ("magic", u64), ("layout", u32), ("state_size", u32), ("command_size", u32), ("joints", u32), ("slot", u32),
        ("claim", u32), ("pid", u32), ("reserved", u32), ("run", u64), ("name", ctypes.c_char * 64),
        ("reserved_tail", ctypes.c_uint8 * 24),
    ]  # fmt: skip


class Welcome(Message):
    """Reply of the plant to a `Hello`. Its layout never changes."""

    verdict: int
    joints: int
    mode: int
    pace: int
    period_ns: int
    ticks: int
    run: int
    task: bytes

    _fields_ = [
        ("magic", u64), ("layout", u32), ("state_size", u32), ("command_size", u32), ("verdict", u32), ("joints", u32),
        ("mode", u32), ("pace", u32), ("slots", u32), ("period_ns", u64), ("ticks", u64), ("run", u64),
        ("task", ctypes.c_char * 1024), ("reserved_tail", ctypes.c_uint8 * 48),
    ]  # fmt: skip


class Run:
    """Description of the run: joints (number), mode (TORQUE, DRIVEN or SERVO), pace (LOCKSTEP or REALTIME), period (s) and
    ticks (number)."""

    def __init__(self, welcome: Welcome) -> None:
        self.joints = welcome.joints
        self.mode = welcome.mode
        self.pace = welcome.pace
        self.period = welcome.period_ns * 1e-9
        self.ticks = welcome.ticks


class Answer:
    """An answer with more than one number for each joint.

    value: torques, N·m, or with the modes DRIVEN and SERVO positions, rad. velocity, acceleration: those of the positions.
    deviation: predicted tool deviation x, y, z, m. status: OK, QP_FAILED, QP_LIMIT or NO_ANSWER. predict_ns, qp_ns,
    qp_iterations: durations and iterations for the table of latencies.
    """

    __slots__ = (
        "value", "velocity", "acceleration", "deviation", "status", "predict_ns", "qp_ns", "qp_iterations",
    )  # fmt: skip

    def __init__(
        self,
        value: Sequence[float],
        velocity: Sequence[float] = (),
        acceleration: Sequence[float] = (),
        deviation: Sequence[float] = (0.0, 0.0, 0.0),
        status: int = OK,
        predict_ns: int = 0,
        qp_ns: int = 0,
        qp_iterations: int = 0,
    ) -> None:
        self.value = value
        self.velocity = velocity
        self.acceleration = acceleration
        self.deviation = deviation
        self.status = status
        self.predict_ns = predict_ns
        self.qp_ns = qp_ns
        self.qp_iterations = qp_iterations


class Controller:
    """Base class of controllers. Answers should depend only on the task and the states, so that `freeplay replay` can
    reproduce them."""

    name = "python"

    def start(self, task: dict[str, Any], run: Run) -> None:
        """Prepares the controller before the first state. `task` is the task file as a dict (model, gravity, rate, path,
        gains, options; the model's path is absolute). Put slow computations here. An exception ends the process with its
        message."""

    def answer(self, state: State) -> Answer | Sequence[float] | None:
        """Returns the answer to `state`: one number for each joint (torques, or positions with the modes DRIVEN and SERVO),
        an Answer, or None. With None the plant uses its fallback. Every call receives the same object `state`: copy values
        that you keep."""
        raise NotImplementedError

    def take_over(self, state: State) -> None:
        """The loop calls this method after a planned swap, before the first answer that takes effect. Initialise
        integrators here."""


class Failure(Exception):
    """Reason why a controller's process ends before the last tick, with the exit code."""

    def __init__(self, code: int, message: str) -> None:
        super().__init__(message)
        self.code = code


VERDICTS = {
    1: "its hello message does not follow the protocol",
    2: "the plant uses another message layout: install the Python package and freeplay of the same version",
    3: "the arm has another number of joints",
    4: "another controller holds the slot: end it, or use another slot",
    5: "the address is that of another run",
    6: "the run has no slot with this number",
}

# As in Rust: attempts to lock a seat; age at which an empty segment is removed, ms; time between two attempts, s.
LOOKS, BIRTH_MS, LOOK_AGAIN = 20, 200, 0.0005
# In real time: end of sleep before the next tick is due; period of the checks that the plant is alive, ns.
EARLY_NS, LOOK_AROUND_NS = 300_000, 200_000_000
SEGMENTS = Path("/dev/shm")


class Link:
    """Connection of a controller to a run in shared memory. Use it in one thread only."""

    def __init__(self, address: str, name: str, slot: int, patience: float) -> None:
        self.root, self.slot, self.patience = Path(address), slot, patience
        self.states: Any
        self.commands: Any
        self.id = self.root.name
        self.deadline = time.monotonic() + patience
        if not self.root.is_absolute() or not self.id:
            raise Failure(USAGE, f"{address!r} is no address of a run: freeplay run sets FREEPLAY_RUN, or give --run")
        self.share = self._share()
        self.node = self._node()
        door = self._until(
            "the plant does not accept controllers yet", lambda: self._service("hello").request_response(Hello, Welcome).open()
        )
        client = door.client_builder().backpressure_strategy(iox().BackpressureStrategy.DiscardData).create()
        self.seat, self.plant = self._lock_file(f"slot-{slot}.lock"), self._lock_file("plant.lock")
        claim = self._take_seat()
        if claim:
            self._open_ends()
        self.welcome = self._knock(client, name, claim)
        if self.welcome.verdict != 0:
            raise Failure(
                BAD_INPUT,
                f"the plant refused this controller: {VERDICTS.get(self.welcome.verdict, 'unknown reason')}",
            )

    def next_state(self, state: State) -> bool:
        """Copies the oldest unread state to `state`. Returns False if no state waits."""
        sample = self.states.receive()
        if sample is None:
            return False
        ctypes.memmove(ctypes.byref(state), sample.payload_ptr, ctypes.sizeof(State))
        sample.delete()
        return True

    def newest_state(self, state: State) -> bool:
        """Copies the newest unread state to `state` and drops the others. Returns False if no state waits."""
        found = False
        while self.next_state(state):
            found = True
        return found

    def send(self, command: Command) -> None:
        """Sends `command` to the plant without waiting."""
        self.commands.send_copy(command)

    def plant_lives(self) -> bool:
        """Returns True if the process of the plant holds its lock."""
        return is_locked(self.plant)

    def close(self) -> None:
        """Leaves the run: closes the ports before the node, and the locks last."""
        self.states = self.commands = None
        gc.collect()
        self.node = None
        for file in (self.seat, self.plant, self.share):
            os.close(file)

    def _share(self) -> int:
        try:
            folder = os.open(self.root, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
            fcntl.flock(folder, fcntl.LOCK_SH)
        except OSError as error:
            raise Failure(
                PEER_MISSING, f"no run lives at {self.root}: it has ended, or the address is wrong ({error.strerror})"
            ) from None
        status = os.fstat(folder)
        if status.st_uid != os.getuid() or status.st_mode & 0o077:
            raise Failure(INTERNAL, f"{self.root} is not a folder of this user alone: start both sides as one user")
        if status.st_nlink == 0:
            raise Failure(PEER_MISSING, f"no run lives at {self.root}: it has ended")
        return folder

    def _node(self) -> Any:
        """The iceoryx2 node, confined to the run's folder and prefix. It handles no signals; dead nodes are removed only
        here."""
        iox().set_log_level_from_env_or(iox().LogLevel.Fatal)
        config = iox().config.default()
        place = config.global_cfg
        place.root_path = iox().Path.new(str(self.root))
        place.prefix = iox().FileName.new(f"freeplay-{self.id}_")
        place.node.cleanup_dead_nodes_on_creation = False
        place.node.cleanup_dead_nodes_on_destruction = False
        place.service.cleanup_dead_nodes_on_open = False
        node = (
            iox()
            .NodeBuilder.new()
            .config(config)
            .signal_handling_mode(iox().SignalHandlingMode.Disabled)
            .create(iox().ServiceType.Ipc)
        )
        self._remove_unborn()
        node.blocking_cleanup_dead_nodes(iox().Duration.from_millis(500))
        return node

    def _remove_unborn(self) -> None:
        """Removes empty segments, which a process leaves if it is killed while it creates them: iceoryx2 would wait for them
        forever."""
        unborn = [path for path in SEGMENTS.glob(f"freeplay-{self.id}_*") if is_empty(path)]
        for _ in range(BIRTH_MS):
            if not unborn:
                return
            time.sleep(0.001)
            unborn = [path for path in unborn if is_empty(path)]
        for path in unborn:
            path.unlink(missing_ok=True)

    def _service(self, name: str) -> Any:
        return self.node.service_builder(iox().ServiceName.new(f"freeplay/{name}"))

    def _open_ends(self) -> None:
        """Opens the ports for commands and states. With another layout they stay closed, and the plant reports the reason."""
        discard = iox().BackpressureStrategy.DiscardData
        try:
            commands = self._service(f"command/{self.slot}").publish_subscribe(Command).open()
            states = self._service("state").publish_subscribe(State).open()
        except iox().PublishSubscribeOpenError:
            return
        self.commands = commands.publisher_builder().max_loaned_samples(1).backpressure_strategy(discard).create()
        self.states = states.subscriber_builder().create()

    def _lock_file(self, name: str) -> int:
        flags = os.O_CREAT | os.O_APPEND | os.O_RDWR | os.O_NOFOLLOW | os.O_CLOEXEC
        return os.open(self.root / name, flags, 0o600)

    def _take_seat(self) -> bool:
        for _ in range(LOOKS):
            try:
                fcntl.flock(self.seat, fcntl.LOCK_EX | fcntl.LOCK_NB)
                return True
            except BlockingIOError:
                time.sleep(0.001)
        return False

    def _knock(self, client: Any, name: str, claim: bool) -> Welcome:
        """Sends a hello until the plant replies."""
        hello = Hello(
            magic=MAGIC, layout=LAYOUT_VERSION, state_size=ctypes.sizeof(State), command_size=ctypes.sizeof(Command),
            slot=self.slot, claim=claim, pid=os.getpid(), run=run_hash(self.id), name=cut(name, 64),
        )  # fmt: skip
        while True:
            pending = client.send_copy(hello)
            while True:
                # The reply may arrive between these two checks, so the order matters.
                is_held = pending.number_of_server_connections > 0 and pending.is_connected
                response = pending.receive()
                if response is not None:
                    return Welcome.from_buffer_copy(
                        (ctypes.c_char * ctypes.sizeof(Welcome)).from_address(response.payload_ptr)
                    )
                self._wait("the plant is running, but does not answer the hello")
                if not is_held:
                    break

    def _until(self, obstacle: str, attempt: Callable[[], Opened]) -> Opened:
        while True:
            try:
                return attempt()
            except iox().RequestResponseOpenError as error:
                self._wait(f"{obstacle}: {error}")

    def _wait(self, obstacle: str) -> None:
        if time.monotonic() > self.deadline:
            raise Failure(PEER_MISSING, f"no plant answered within {self.patience} s ({obstacle}): is it running?")
        time.sleep(LOOK_AGAIN)


class Loop:
    """The loop of a controller's process: waits for a state, answers it and sends the answer."""

    def __init__(self, link: Link, controller: Controller, stop: list[bool]) -> None:
        self.link, self.controller, self.stop = link, controller, stop
        self.run, self.run_hash = Run(link.welcome), link.welcome.run
        self.period_ns, self.parent = link.welcome.period_ns, os.getppid()
        self.state, self.due_ns, self.answered = State(), 0, 0
        self.command = Command(magic=MAGIC, layout=LAYOUT_VERSION, slot=link.slot)

    def play(self) -> bool:
        """Answers every state until the last one of the run. Returns False after a signal."""
        state, command = self.state, self.command
        while self.wait():
            command.received_ns = time.monotonic_ns()
            self.check()
            if state.next_in_charge == self.link.slot != state.in_charge:
                self.controller.take_over(state)
            self.fill(self.controller.answer(state))
            command.sent_ns = time.monotonic_ns()
            self.link.send(command)
            self.answered += 1
            if state.flags & FLAG_LAST:
                return True
        return False

    def check(self) -> None:
        """Checks that the state belongs to this run and has this layout."""
        state = self.state
        if (state.magic, state.layout, state.run, state.joints) != (
            MAGIC,
            LAYOUT_VERSION,
            self.run_hash,
            self.run.joints,
        ):
            raise Failure(
                BAD_INPUT, f"a state has another run or layout: layout {state.layout}, {state.joints} joints"
            )

    def fill(self, answer: Answer | Sequence[float] | None) -> None:
        """Fills the command with `answer` to the current state."""
        command, state, n = self.command, self.state, self.run.joints
        command.joints, command.run, command.tick = n, state.run, state.tick
        command.kind = KIND_TORQUE if state.mode == TORQUE else KIND_POSITION
        if answer is None:
            answer = Answer([0.0] * n, status=NO_ANSWER)
        elif not isinstance(answer, Answer):
            answer = Answer(answer)
        if len(answer.value) != n:
            raise ValueError(f"the answer has {len(answer.value)} numbers, the arm has {n} joints")
        command.value[:n] = list(answer.value)
        for target, values in ((command.velocity, answer.velocity), (command.acceleration, answer.acceleration)):
            target[:n] = list(values) if len(values) else [0.0] * n
        command.deviation[:] = list(answer.deviation)
        command.status = answer.status
        command.predict_ns, command.qp_ns, command.qp_iterations = answer.predict_ns, answer.qp_ns, answer.qp_iterations

    def wait(self) -> bool:
        """Waits for a state: in lockstep the next one, in real time the newest one. Returns False after a signal."""
        lockstep = self.run.pace == LOCKSTEP
        take = self.link.next_state if lockstep else self.link.newest_state
        begun = looked = time.monotonic_ns()
        while not self.stop:
            if take(self.state):
                self.due_ns = min(self.state.scheduled_ns, time.monotonic_ns()) + self.period_ns
                return True
            now = time.monotonic_ns()
            if now - looked > LOOK_AROUND_NS:
                looked = now
                self.look_around((now - begun) * 1e-9)
            self.pass_time(now, now - begun, lockstep)
        return False

    def pass_time(self, now: int, waited: int, lockstep: bool) -> None:
        """Sleeps until shortly before the next state is due, then polls. Sleeps between polls if the state is late."""
        early = 0 if lockstep else self.due_ns - EARLY_NS - now
        if early > 0:
            time.sleep(min(early, 100_000_000) * 1e-9)
        elif waited > 2_000_000 and (lockstep or now > self.due_ns + self.period_ns):
            time.sleep(0.00005)
        elif lockstep:
            os.sched_yield()

    def look_around(self, waited: float) -> None:
        """After `waited` seconds without a state: raises Failure if the run has ended or the patience is exceeded."""
        if not self.link.plant_lives():
            cause = ": its process has ended"
        elif os.getppid() != self.parent:
            cause = ": the process that started this controller has ended"
        elif waited > self.link.patience:
            cause = ""
        else:
            return
        raise Failure(
            PEER_MISSING, f"the plant is gone: no state for {waited:.1f} s after {self.answered} states{cause}"
        )


def serve(controller: Controller, arguments: Sequence[str] | None = None, patience: float = 10.0) -> NoReturn:
    """Runs `controller` until the end of the run, and then ends the process. The command line (--run, --slot) or the
    environment (FREEPLAY_RUN, FREEPLAY_SLOT) names the run. Exit codes: 0 done, 2 usage, 3 bad input, 5 plant missing, 70
    exception in the controller, 130 interrupted."""
    stop: list[bool] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.append(True))
    try:
        code = _serve(controller, sys.argv[1:] if arguments is None else arguments, patience, stop)
    except Failure as failure:
        print(f"{controller.name}: {failure}", file=sys.stderr)
        code = failure.code
    except Exception:
        traceback.print_exc()
        print(f"{controller.name}: the controller raised an exception; the plant continues with its fallback", file=sys.stderr)
        code = INTERNAL
    sys.exit(code)


def _serve(controller: Controller, arguments: Sequence[str], patience: float, stop: list[bool]) -> int:
    address, slot = _place(arguments)
    link = Link(address, controller.name, slot, patience)
    try:
        loop = Loop(link, controller, stop)
        controller.start(load_task(link.welcome.task.decode()), loop.run)
        # Freezes all existing objects, so that garbage collections during the run examine only new ones.
        gc.collect()
        gc.freeze()
        return DONE if loop.play() else INTERRUPTED
    finally:
        link.close()


def _place(arguments: Sequence[str]) -> tuple[str, int]:
    """The address of the run and the slot, from the command line or from the environment."""
    found: dict[str, str | None] = {"--run": os.environ.get("FREEPLAY_RUN"), "--slot": os.environ.get("FREEPLAY_SLOT", "0")}
    rest = iter(arguments)
    for argument in rest:
        flag, equals, value = argument.partition("=")
        if flag in found:
            found[flag] = value if equals else next(rest, None)
    address, slot = found["--run"], found["--slot"] or ""
    if not address:
        raise Failure(
            USAGE, "no run to join: freeplay run sets FREEPLAY_RUN for its controllers, or give --run ADDRESS"
        )
    if not slot.isdigit():
        raise Failure(USAGE, f"slot {found['--slot']!r} is not a number: give --slot 0")
    return address, int(slot)


def load_task(path: str) -> dict[str, Any]:
    """Reads the task file as a dict. Makes the path of the model, which is relative to the file, absolute."""
    try:
        import tomllib
    except ModuleNotFoundError:  # Python 3.10
        import tomli as tomllib  # type: ignore[no-redef, unused-ignore]

    try:
        task = tomllib.loads(Path(path).read_text())
    except (OSError, ValueError) as error:
        raise Failure(BAD_INPUT, f"cannot read the task file {path}: {error}") from None
    if task.get("model", "paper") != "paper":
        task["model"] = str(Path(path).parent / task["model"])
    return task


def iox() -> Any:
    """Imports iceoryx2 in the version of the plant."""
    global _iox
    if _iox is None:
        from importlib import metadata

        try:
            found = metadata.version("iceoryx2")
        except metadata.PackageNotFoundError:
            found = "none"
        if found != ICEORYX2:
            remedy = f"{sys.executable} -m pip install iceoryx2=={ICEORYX2}"
            raise Failure(BAD_INPUT, f"this controller needs iceoryx2 {ICEORYX2}, but this Python has {found}: {remedy}")
        import iceoryx2

        _iox = iceoryx2
    return _iox


_iox: Any = None


def run_hash(text: str) -> int:
    """Hash of a run's id in messages: FNV-1a, 64 bit."""
    value = 0xCBF29CE484222325
    for byte in text.encode():
        value = (value ^ byte) * 0x100000001B3 & 0xFFFFFFFFFFFFFFFF
    return value


def cut(text: str, size: int) -> bytes:
    """The first complete characters of `text` that fit into `size` bytes of UTF-8."""
    return text.encode()[:size].decode(errors="ignore").encode()


def is_locked(file: int) -> bool:
    """Returns True if another process holds a lock on the open `file`."""
    try:
        fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    fcntl.flock(file, fcntl.LOCK_UN)
    return False


def is_empty(path: Path) -> bool:
    """Returns True if the file `path` exists and is empty."""
    try:
        return path.stat().st_size == 0
    except OSError:
        return False

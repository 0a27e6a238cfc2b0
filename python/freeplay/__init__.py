"""Freeplay in Python: it finds the physics that a robot model lacks, and tests controllers on simulated arms whose joints have play.

The package starts the `freeplay` command of its wheel and exchanges data with it as Parquet, MCAP and JSON. Units are SI
everywhere: rad, m, s, N*m (m and N for prismatic joints). A name that ends in `_mm` or `_us` has that unit.

The names, in the order of the data flow:

- `Recording` is a recording of a machine, and `Arm` is a model of it. `compare` measures the residuals between them.
- `diagnose` finds the missing physics. A `Diagnosis` holds the findings, their charts and the completed model.
- `run` simulates a scenario with controllers, and `Run` holds frames and latencies. Derive your controller from `Controller`; `serve` runs it.
- `examine` injects faults into a controller and judges how the run handles each fault.
- `blind` tests the diagnosis on concealed effects. `campaign` distributes many cases over cores and machines.
- Every error is a `FreeplayError` with the message of the command.

The package also exports the controller SDK (`State`, `Command`, `Answer`, `Link`, …). The module `freeplay.controller` is the SDK alone.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from .controller import (
    BAD_INPUT,
    DONE,
    DRIVEN,
    FLAG_FALLBACK,
    FLAG_LAST,
    FLAG_TOOL_TRACKED,
    ICEORYX2,
    INTERNAL,
    INTERRUPTED,
    KIND_POSITION,
    KIND_TORQUE,
    LAYOUT_VERSION,
    LOCKSTEP,
    MAGIC,
    MAX_JOINTS,
    NO_ANSWER,
    OK,
    PEER_MISSING,
    QP_FAILED,
    QP_LIMIT,
    REALTIME,
    TORQUE,
    USAGE,
    Answer,
    Command,
    Controller,
    Failure,
    Hello,
    Link,
    Loop,
    Reference,
    State,
    Welcome,
    load_task,
    run_hash,
    serve,
)

if TYPE_CHECKING:
    from .arm import Arm
    from .campaigns import Campaign, campaign
    from .comparison import Comparison, compare
    from .diagnosis import Diagnosis, diagnose
    from .errors import (
        BadInput,
        BadUsage,
        FreeplayError,
        InternalFault,
        Interrupted,
        MachineNotFit,
        NotInstalled,
        PeerMissing,
    )
    from .exams import Exam, examine
    from .proof import Proof, blind
    from .recording import Recording
    from .runs import Run, run

# The modules that need pandas, by exported name. The first use of a name imports its module, so that a controller starts without pandas.
_HOMES = {
    "Arm": "arm",
    "Campaign": "campaigns",
    "campaign": "campaigns",
    "Comparison": "comparison",
    "compare": "comparison",
    "Diagnosis": "diagnosis",
    "diagnose": "diagnosis",
    "BadInput": "errors",
    "BadUsage": "errors",
    "FreeplayError": "errors",
    "InternalFault": "errors",
    "Interrupted": "errors",
    "MachineNotFit": "errors",
    "NotInstalled": "errors",
    "PeerMissing": "errors",
    "Exam": "exams",
    "examine": "exams",
    "Proof": "proof",
    "blind": "proof",
    "Recording": "recording",
    "Run": "runs",
    "run": "runs",
}

__all__ = [
    "Arm", "BadInput", "BadUsage", "Campaign", "Comparison", "Diagnosis", "Exam", "FreeplayError", "InternalFault",
    "Interrupted", "MachineNotFit", "NotInstalled", "PeerMissing", "Proof", "Recording", "Run", "blind", "campaign",
    "compare", "diagnose", "examine", "run",
    "BAD_INPUT", "DONE", "DRIVEN", "FLAG_FALLBACK", "FLAG_LAST", "FLAG_TOOL_TRACKED", "ICEORYX2", "INTERNAL",
    "INTERRUPTED", "KIND_POSITION", "KIND_TORQUE", "LAYOUT_VERSION", "LOCKSTEP", "MAGIC", "MAX_JOINTS", "NO_ANSWER",
    "OK", "PEER_MISSING", "QP_FAILED", "QP_LIMIT", "REALTIME", "TORQUE", "USAGE", "Answer", "Command", "Controller",
    "Failure", "Hello", "Link", "Loop", "Reference", "State", "Welcome", "load_task", "run_hash", "serve",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from ._command import version

        return version()
    if name in _HOMES:
        value = getattr(importlib.import_module(f".{_HOMES[name]}", __name__), name)
        globals()[name] = value
        return value
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})

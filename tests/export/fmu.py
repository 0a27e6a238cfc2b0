"""Runs an FMU with FMPy: validates it, steps it with the inputs from standard input, and prints every output after every step as hex.

Input: {"fmu", "parameters": {name: value}, "brakes": [bool per step], "given": [[per joint] or null per step], "names": [outputs],
"inputs": [names], "rewind": step or null}. With `rewind` the script saves and serialises the state at that step, and restores it at the end. The repeated steps
must give the same outputs.
"""

import json
import struct
import sys
import tempfile

import fmpy
import numpy as np
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu

order = json.load(sys.stdin)
problems = validate_fmu(order["fmu"])
assert not problems, problems
description = fmpy.read_model_description(order["fmu"])
reference = {variable.name: variable.valueReference for variable in description.modelVariables}
folder = fmpy.extract(order["fmu"], unzipdir=tempfile.mkdtemp())
fmu = FMU3Slave(guid=description.guid, unzipDirectory=folder, modelIdentifier=description.coSimulation.modelIdentifier, instanceName="arm")
fmu.instantiate()
for name, value in order["parameters"].items():
    fmu.setFloat64([reference[name]], [value])
fmu.enterInitializationMode(startTime=0.0)
fmu.exitInitializationMode()
outputs = [reference[name] for name in order["names"]]
inputs = [reference[name] for name in order["inputs"]]
brakes = [reference["brakes"]]


def play(first, last):
    rows = []
    for step in range(first, last):
        if order["given"][step] is not None:
            fmu.setFloat64(inputs, order["given"][step])
        fmu.setBoolean(brakes, [order["brakes"][step]])
        fmu.doStep(currentCommunicationPoint=step * 1e-3, communicationStepSize=1e-3)
        rows.append(struct.pack(f"<{len(outputs)}d", *fmu.getFloat64(outputs)).hex())
    return rows


steps, rewind = len(order["given"]), order["rewind"]
rows = play(0, rewind or steps)
if rewind:
    state = fmu.getFMUState()
    data = fmu.serializeFMUState(state)
    rows += play(rewind, steps)
    for put_back in (state, fmu.deserializeFMUState(data)):
        fmu.setFMUState(put_back)
        again = play(rewind, steps)
        assert again == rows[rewind:], "a state that was put back gives other numbers"
        fmu.freeFMUState(put_back)
fmu.terminate()
fmu.freeInstance()
print(json.dumps(rows))

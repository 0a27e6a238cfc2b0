"""Recomputes every hash in a receipt of `freeplay blind`: python3 verify.py receipt.json"""

import hashlib, json, struct, sys

def once(pairs):
    assert len(dict(pairs)) == len(pairs), "a key stands twice"
    return dict(pairs)

def canonical(value):
    if isinstance(value, dict):
        return "{" + ",".join(f"{canonical(key)}:{canonical(value[key])}" for key in sorted(value)) + "}"
    if isinstance(value, list):
        return "[" + ",".join(map(canonical, value)) + "]"
    if isinstance(value, float):
        return "f" + struct.pack(">d", value).hex()
    return json.dumps(value, ensure_ascii=False)

def sha256(purpose, value):
    return hashlib.sha256(f"{purpose}\n{canonical(value)}".encode()).hexdigest()

receipt = json.load(open(sys.argv[1], encoding="utf-8"), object_pairs_hook=once)
cases, wrong, sealed = receipt["cases"], [], []
for part in receipt["parts"]:
    mine = {name: cases[name] for name in part["sealed"]}
    sealed += mine
    revealed = any(stage["name"] == "reveal" for stage in part["stages"])
    wrong += [f"truth of {n}" for n, c in part["commitments"].items() if revealed and n in mine and c != sha256("truth", [mine[n]["salt"], mine[n]["truth"]])]
    brought = {
        "freeze": [part["program"], part["machine"]],
        "seed": part["draw"],
        "seal": [part["sealed"], part["commitments"], part["not_made"], part["seconds"][0]],
        "answer": [sha256("answers", {n: c["answer"] for n, c in mine.items()}), part["isolation"], part["seconds"][1]],
        "reveal": {n: [c["salt"], c["truth"]] for n, c in mine.items()},
    }
    before = ""
    for stage in part["stages"]:
        chain = sha256("chain", [before, stage["name"], stage["at"], sha256(stage["name"], brought[stage["name"]])])
        wrong += [f"stage {stage['name']}"] if chain != stage["chain"] else []
        before = stage["chain"]
wrong += ["cases"] if sorted(sealed) != sorted(cases) or not sealed else []
wrong += ["receipt"] if receipt.pop("sha256") != sha256("receipt", receipt) else []
print("; ".join(wrong) or f"every hash holds: {len(cases)} cases, chain {before}")
sys.exit(bool(wrong))

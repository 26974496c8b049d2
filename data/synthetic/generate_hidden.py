"""Writes the records of a machine with a hidden cause: `python data/synthetic/generate_hidden.py`.

Three two-hour tests at 1 Hz of a machine whose fan sits on its shaft, which no two-node network
knows of. What is hidden, and how strongly, stands in `truth.json` beside them.
"""

from __future__ import annotations

import argparse
import gzip
import importlib
import io
import json
import sys
from pathlib import Path

import pandas as pd

HERE = Path(__file__).parent
SEED = 77
HIDDEN = "speed_cooling"


def main() -> None:
    """Write records, motor file and truth."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=HERE / "hidden_cause")
    folder = parser.parse_args().out
    sys.path.insert(0, str(HERE))
    hidden = importlib.import_module("generator.hidden")
    case = hidden.make_case((HIDDEN,), SEED, target_K=0.8, resolution_K=0.1)
    folder.mkdir(exist_ok=True)
    names = ("staircase", "drive_cycle", "other_staircase")
    for name, test in zip(names, case.tests, strict=True):
        table = pd.DataFrame(test.columns).iloc[::2]
        text = table.to_csv(index=False, float_format="%.5g").encode()
        packed = io.BytesIO()
        with gzip.GzipFile(fileobj=packed, mode="wb", mtime=0) as stream:
            stream.write(text)
        (folder / f"{name}.csv.gz").write_bytes(packed.getvalue())
    machine = case.machine
    (folder / "motor.toml").write_text(
        f"""[motor]
name = "Machine with a hidden cause"
losses = "{case.losses}"
rated_speed_rpm = {machine.rated_speed_rpm:.1f}
insulation_class = "F"

[winding]
material = "copper"
phase_resistance_ohm = {machine.phase_resistance_ohm:.5g}
reference_temperature_degC = 25.0
""",
        encoding="utf-8",
    )
    truth = {
        "hidden": list(case.hidden),
        "amplitudes": case.amplitudes,
        "law": "conductance to the sink times 1 + 1.5 a s^p behind a lag of 8 s, 0.65 < p < 0.85",
        "visible_misfit_K": case.visible_misfit_K,
        **{name: getattr(machine, name) for name in ("Ceq_w", "Ceq_sr", "Req_w", "Req_sr")},
    }
    (folder / "truth.json").write_text(json.dumps(truth, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()

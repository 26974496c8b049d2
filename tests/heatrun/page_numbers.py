"""What a sheet says, from its printed numbers alone: simulate them, and look at the error."""

import json
from pathlib import Path

import numpy as np

import heatrun


def said_and_simulated(folder: Path) -> list[tuple[float, float]]:
    """Return the RMSE of each fitted test as the page says it, and of its numbers simulated [K]."""
    run = heatrun.open_run(folder)
    fit = json.loads((folder / "fit.json").read_text(encoding="utf-8"))
    name = list(fit["models"])[-1]
    page = fit["models"][name]
    numbers = {n: e["value"] for n, e in {**page["parameters"], **page["nuisances"]}.items()}
    rmse = {row["test"]: row["rmse_K"] for row in page["residuals"]}
    pairs = []
    for test in run.tests:
        if test.role != "calibration":
            continue
        blocks = run.predict(run.source(test), network=name).test
        values = {n.removesuffix(f"[{test.name}]"): v for n, v in numbers.items()
                  if "[" not in n or n.endswith(f"[{test.name}]")}  # fmt: skip
        model = run.model(name).model
        nulls = {f"{kind.card.id}.{n}": q.null for kind in model.effects
                 for n, q in kind.card.parameters.items() if q.null is not None}  # fmt: skip
        means = np.asarray(model.block_means(nulls | values, blocks.observation()))
        error = (blocks.measured - means[: blocks.measured.size])[blocks.is_observed]
        pairs.append((rmse[test.name], float(np.sqrt(np.mean(error**2)))))
    return pairs

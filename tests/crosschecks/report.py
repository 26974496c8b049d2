"""The cross-checks as a page of tables."""

from __future__ import annotations

from typing import Any

PUBLISHED = """## A published fit, rebuilt

Not possible from the sources at hand. The thesis that the reference parameters come from prints
22 samples (2.1 s) of the worksheet that they were estimated on, the estimates, and no figure of
the course in numbers; a fit needs the rest of the record. What is printed can be checked: every
cell of the worksheet follows from its inputs (`tests/heatrun/test_worksheet.py`).
"""


def markdown(result: dict[str, Any]) -> str:
    """Return the page."""
    about = result["about"]
    versions = ", ".join(f"{name} {number}" for name, number in about["versions"].items())
    parts = [
        "# Cross-checks with tools that others wrote",
        f"`{about['command']}`, seed {about['seed']}, {about['date']}, Python {about['python']}, "
        f"{versions}.",
        _simulation(result["simulation"]),
        _fit(result["fit"]),
        *(_posterior(test, found) for test, found in result["posterior"].items()),
        PUBLISHED,
    ]
    return "\n\n".join(part.strip() for part in parts) + "\n"


def _table(head: list[str], rows: list[list[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _simulation(rows: list[dict]) -> str:
    columns = list(rows[0]["gaps_K"])
    table = _table(
        ["record, step", "network", *columns],
        [
            [
                f"{row['record']}, {row['step_s']:g} s",
                row["network"],
                *(f"{row['gaps_K'][column]:.1e}" for column in columns),
            ]
            for row in rows
        ],
    )
    return (
        "## The same simulation\n\nLargest difference of any node at any edge [K]. The balances "
        "were written again from their equations, without code of `lptn`; inputs are constant "
        f"over each step.\n\n{table}"
    )


def _fit(fits: dict[str, dict]) -> str:
    names = list(next(iter(fits.values()))["gap_in_sd"])
    table = _table(
        ["parameter", *fits],
        [[name, *(f"{fit['gap_in_sd'][name]:+.1e}" for fit in fits.values())] for name in names]
        + [
            [
                "sum of squares, heatrun − scipy",
                *(
                    f"{fit['sum_of_squares_heatrun'] - fit['sum_of_squares_scipy']:+.1e}"
                    for fit in fits.values()
                ),
            ]
        ],
    )
    return (
        "## The same fit\n\n`scipy.optimize.least_squares` with derivatives by differences, on a "
        "fourth-order simulator in numba, a dense noise covariance and the priors written anew, "
        "from a start off by a factor of two in each network parameter. scipy's optimum minus "
        f"heatrun's, in posterior standard deviations.\n\n{table}"
    )


def _posterior(test: str, found: dict) -> str:
    statistics, about, pairs = found["statistics"], found["about"], found["pairs"]
    samplers = _table(
        ["sampler", "smallest bulk ESS", "largest R-hat", "seconds", "said"],
        [
            [
                name,
                _least(rows, "ess_bulk", min, "{:.0f}"),
                _least(rows, "rhat", max, "{:.4f}"),
                f"{about[name]['seconds']:.0f}",
                about[name]["said"],
            ]
            for name, rows in statistics.items()
        ],
    )
    agreement = _table(
        ["pair", "largest \\|z\\|", "rms z"],
        [[name, f"{pair['largest']:.2f}", f"{pair['rms']:.2f}"] for name, pair in pairs.items()],
    )
    labels = list(statistics)
    values = _table(
        ["parameter", *labels],
        [
            [
                name,
                *(
                    f"{statistics[label][name]['mean'][0]:+.4f} ± "
                    f"{statistics[label][name]['mean'][1]:.4f}; "
                    f"{statistics[label][name]['sd'][0]:.4f} ± "
                    f"{statistics[label][name]['sd'][1]:.4f}"
                    for label in labels
                ),
            ]
            for name in statistics[labels[0]]
        ],
    )
    return (
        f"## The same posterior, {test}\n\nSecond order, all free parameters and the noise, in "
        f"standard scores of their priors.\n\n{samplers}\n\nDifferences of mean, sd and the "
        "2.5, 50 and 97.5 % quantiles of every parameter over their joint Monte Carlo error "
        f"(ArviZ; delta method for weighted draws); 1 is what chance makes of the rms.\n\n"
        f"{agreement}\n\nMean and sd of each parameter, each ± its Monte Carlo error.\n\n{values}"
    )


def _least(rows: dict, key: str, choose, form: str) -> str:
    if any(key not in row for row in rows.values()):
        return ""
    return form.format(choose(row[key][0] for row in rows.values()))

"""Unmodelled heat, held against an integration that shares nothing with it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from heatrun.model.discrepancy import block_responses, heat_columns
from heatrun.model.model import Model
from heatrun.record.motor import Adequacy
from lptn import second_order

C_W, C_S, R_W, R_S = 700.0, 15000.0, 0.145, 0.116


def reading(node, course, edges):
    """Block means of the winding for heat in a node, integrated as written down in the thesis."""

    def slope(t, T):
        heat = np.interp(t, edges, course)
        flow = (T[0] - T[1]) / R_W
        in_winding, in_stator = (heat, 0.0) if node == "winding" else (0.0, heat)
        return [(in_winding - flow) / C_W, (in_stator + flow - T[1] / R_S) / C_S]

    fine = np.linspace(edges[0], edges[-1], 20 * (edges.size - 1) + 1)
    T = solve_ivp(slope, (fine[0], fine[-1]), [0.0, 0.0], t_eval=fine, rtol=1e-9, atol=1e-9,
                  max_step=5.0).y[0]  # fmt: skip
    return np.array([np.trapezoid(T[i : i + 21]) / 20 for i in range(0, fine.size - 1, 20)])


def test_responses_are_those_of_an_integrated_network():
    edges = 20.0 * np.arange(91)
    course = np.random.default_rng(0).standard_normal((91, 1))
    found = block_responses(second_order(C_W, C_S, R_W, R_S), ["winding"], course, 20.0)
    assert set(found) == {"winding", "stator"}
    for node, means in found.items():
        exact = reading(node, course[:, 0], edges)
        np.testing.assert_allclose(means[:, 0], exact, atol=2e-4 * np.max(np.abs(exact)))


@pytest.mark.parametrize("said", [Adequacy(), Adequacy(unmodelled_heat=0.003, heat_time_s=600.0)])
def test_columns_have_the_variance_of_drawn_heat(motor, blocks, said):
    """Heat drawn as a Gauss-Markov process step by step, through the integrated network."""
    values = {"Ceq_w": C_W, "Ceq_sr": C_S, "Req_w": R_W, "Req_sr": R_S, "Rs0": 0.006}
    columns = heat_columns(Model.of("second", replace(motor, adequacy=said)), values, blocks)
    rng = np.random.default_rng(1)
    wider = said.unmodelled_heat / Adequacy().unmodelled_heat
    loss = wider * float(np.mean(np.asarray(blocks.inputs.losses)))
    edges = blocks.block_s * np.arange(blocks.measured.size + 1)
    decay = np.exp(-blocks.block_s / said.heat_time_s)
    drawn = []
    for _ in range(150):
        total = np.zeros(blocks.measured.size)
        for node in ("winding", "stator"):
            heat = [rng.standard_normal()]
            for shock in rng.standard_normal(edges.size - 1):
                heat.append(decay * heat[-1] + np.sqrt(1.0 - decay**2) * shock)
            only = block_responses(
                second_order(C_W, C_S, R_W, R_S), ["winding"], loss * np.array(heat)[:, None],
                blocks.block_s,
            )[node]  # fmt: skip
            total += only[:, 0]
        drawn.append(total)
    late = slice(blocks.measured.size // 3, None)
    sampled = np.mean(np.square(drawn), axis=0)[late].mean()
    stated = np.sum(columns**2, axis=1)[late].mean()
    # 150 records of some four independent stretches each: a sd of 6 %; 4 of them
    assert abs(sampled / stated - 1.0) < 0.24

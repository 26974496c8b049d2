"""A winding apart from the one node: with it the first order is the second."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest
from compiled import reading, simulate

import lptn
from lptn import EFFECTS, CopperLosses
from lptn.effects import applies, build, build_all
from lptn.effects.bodies import HousingNode, NeighbourBody, RotorNode, WindingNode
from lptn.effects.cooling import SpeedCooling
from lptn.effects.losses import AcCopperLoss

Ceq_w, Ceq_sr, Req_w, Req_sr = 666.75, 15060.1, 0.14485, 0.11625
ONE = lptn.first_order(Ceq_w + Ceq_sr, Req_sr)
SHARE = Ceq_w / (Ceq_w + Ceq_sr)
SAME = {"x": Req_w / Req_sr, "tau": Req_w * Ceq_w * Ceq_sr / (Ceq_w + Ceq_sr)}
"""By hand: two bodies through a resistance even out with R C1 C2/(C1 + C2)."""

START = {"winding": jnp.asarray(21.0)}
BOTH = {"winding": jnp.asarray(21.0), "stator": jnp.asarray(21.0)}

beside = pytest.mark.parametrize(
    ("kind", "values"),
    [
        (SpeedCooling, {"g": 1.5, "m": 0.8}),
        (AcCopperLoss, {"k": 0.5}),
        (NeighbourBody, {"C": 5000.0, "tau": 1500.0}),
        (HousingNode, {"x": 0.4, "tau": 300.0}),
        (RotorNode, {"p": 0.2, "C": 2e4, "tau": 900.0}),
    ],
    ids=lambda value: getattr(getattr(value, "card", None), "id", None),
)


@pytest.mark.parametrize("loss_kind", ["balance", "map"])
def test_the_first_order_with_it_is_the_second(loss_kind, short):
    losses = CopperLosses(Rs0=jnp.asarray(0.0062), kind=loss_kind)
    effects = [build(WindingNode, SAME, ONE)]
    found = simulate(ONE, losses, short, START, effects=effects)
    second = simulate(lptn.second_order(Ceq_w, Ceq_sr, Req_w, Req_sr), losses, short, BOTH)
    # K; the affine and the general step differ by rounding
    np.testing.assert_allclose(found.reading, second.reading, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(
        found.flow["winding", "stator"], second.flow["winding", "stator"], rtol=0.0, atol=1e-7
    )


@beside
def test_at_its_null_any_other_effect_does_what_it_does_to_one_node(kind, values, short, losses):
    """A winding that is not there must not bend the signature of what is."""
    gone = [(WindingNode, {"x": 0.0, "tau": 80.0}), (kind, values)]
    alone = reading(ONE, losses, short, START, effects=[build(kind, values, ONE)])
    both = reading(ONE, losses, short, START, effects=build_all(gone, ONE))
    # 1e-12 W/K or shares keep gradients finite
    np.testing.assert_allclose(both, alone, rtol=0.0, atol=1e-8)


@beside
@pytest.mark.parametrize("order", ["before", "after"])
def test_beside_it_any_other_effect_does_what_it_does_to_two_nodes(
    kind, values, order, short, losses
):
    wanted = [(WindingNode, SAME), (kind, values)]
    wanted = wanted if order == "before" else wanted[::-1]
    second = lptn.second_order(Ceq_w, Ceq_sr, Req_w, Req_sr)
    both = reading(ONE, losses, short, START, effects=build_all(wanted, ONE))
    expected = reading(second, losses, short, BOTH, effects=[build(kind, values, second)])
    np.testing.assert_allclose(both, expected, rtol=0.0, atol=1e-8)


def test_a_winding_too_fast_for_the_steps_stays_bounded(short, losses):
    """Close to the null the share is at its limit: what is left goes with the resistance."""
    base = np.asarray(reading(ONE, losses, short, START))
    far, near = (
        reading(ONE, losses, short, START,
                effects=[build(WindingNode, {"x": x, "tau": 80.0}, ONE)]) - base
        for x in (2e-3, 1e-3)
    )  # fmt: skip
    assert 1e-4 < np.max(np.abs(near)) < 0.1
    np.testing.assert_allclose(far, 2.0 * near, rtol=0.02, atol=1e-5)


def test_it_applies_to_one_node_alone(four_nodes, network):
    assert applies(WindingNode, ONE)
    tied = lptn.first_order(1e4, 0.1).with_node(
        "body", capacitance=jnp.asarray(1e3), links={"winding": jnp.asarray(1.0)}
    )
    for other in (four_nodes, network, tied):
        assert not applies(WindingNode, other)
        with pytest.raises(ValueError, match="winding_node"):
            build(WindingNode, SAME, other)
        with pytest.raises(ValueError, match="winding_node"):
            WindingNode(**{k: jnp.asarray(v) for k, v in SAME.items()}).extend(other)
    assert WindingNode in EFFECTS

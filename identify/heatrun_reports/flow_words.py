"""What the heat flows of a network are called in a report: symbol and words, by link."""

from __future__ import annotations

from heatrun.inference.networks.form import NetworkForm

WITHIN = ("winding", "stator")


def flow_words(form: NetworkForm) -> dict[tuple[str, str], tuple[str, str]]:
    """Return symbol and words of the heat flow of each link of a network.

    P_ws and P_se are the two flows of the thesis: from winding to stator, and from the machine to
    the sink that T0 stands for. Of two sinks, that one is named.

    Args:
        form: The network.
    """
    sink = f"the {form.sink}" if form.second_sink else "the sink"
    body = "stator" if "stator" in form.nodes else "winding"
    known = {
        WITHIN: ("P_ws", "winding to stator"),
        (body, form.sink): ("P_se", f"{body if body == 'stator' else 'machine'} to {sink}"),
    }
    return {link: known.get(link, unnamed(link)) for link, _ in form.resistance}


def unnamed(link: tuple[str, str]) -> tuple[str, str]:
    """Return what stands for symbol and words of a flow that has no symbol of its own."""
    return " to ".join(link), "heat flow"

"""The text form of a network: TOML to `NetworkForm` and back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from ...bench.channels.schema import BODIES
from ...errors import InputError, did_you_mean
from ...io.toml_text import check_keys, parse_toml
from ..parameters import Parameter
from .form import WINDING, Link, NetworkForm
from .losses import Shares, losses_of, speed_losses
from .priors import capacitance, prior_text, resistance, said_of

KEYS = ("name", "title", "nodes", "sinks", "links", "losses", "by_speed", "sensors", "effects")
PARAMETER_KEYS = (
    "capacitance", "resistance", "share", "start",
    "value", "sd", "sd_log", "relative_sd", "fixed", "meaning", "basis",
)  # fmt: skip
TWO_SINKS = ("ambient", "coolant")
"""Sinks of a network of two: each is named after the channel that measures it."""

MOST_NODES = 12
"""Nodes of a network: more than one winding sensor will ever tell apart."""


def read_network(data: bytes, where: str) -> NetworkForm:
    """Return the network of a TOML file.

    Args:
        data: The bytes of the file.
        where: The file, for messages.

    Raises:
        InputError: If a section or key is missing, unknown or wrong: with what was expected.
    """
    content = parse_toml(data, where, "network file")
    return network_of(content, where)


def network_of(content: Mapping[str, Any], where: str) -> NetworkForm:
    """As `read_network`, from the parsed content."""
    at = f"{where}, [network]"
    network = content.get("network")
    if not isinstance(network, dict):
        raise InputError(
            "expected a section [network] with nodes, links, losses and sensors.",
            where=where,
            remedy='Write [network] and below it nodes = ["winding", "stator"], for example.',
        )
    check_keys(network, KEYS, at, "key")
    nodes = _names(network, "nodes", at)
    if len(nodes) > MOST_NODES:
        raise InputError(f"{len(nodes)} nodes, expected at most {MOST_NODES}.", where=at)
    sinks = _names(network, "sinks", at) if "sinks" in network else ("ambient",)
    if len(sinks) != 1 and set(sinks) != set(TWO_SINKS):
        raise InputError(
            f"{len(sinks)} sinks, {', '.join(sinks)}; expected one, or ambient and coolant: the "
            "temperature of each is a channel of the record.",
            where=at,
            remedy='Write sinks = ["ambient"], ["coolant"] with [motor] sink = "coolant", or '
            '["coolant", "ambient"].',
        )
    for sink in sinks:
        if sink in nodes:
            raise InputError(f"{sink} is a node and the sink.", where=at, remedy="Rename one.")
    links = _links(network, nodes, sinks, at)
    said = content.get("parameters", {})
    if not isinstance(said, dict) or not all(isinstance(v, dict) for v in said.values()):
        raise InputError("expected sections [parameters.NAME].", where=where)
    for name, keys in said.items():
        check_keys(keys, PARAMETER_KEYS, f"{where}, [parameters.{name}]", "key")
    by_speed = speed_losses(network, nodes, said, at, where)
    copper, share = losses_of(network, nodes, said, at, where)
    form = NetworkForm(
        name=_text(network, "name", at),
        title=str(network.get("title", f"network {network.get('name')}")),
        capacitance=tuple(
            (n, capacitance(n, n == copper and len(nodes) > 1, said, where)) for n in nodes
        ),
        resistance=tuple((link, resistance(link, said, where)) for link in links),
        share=share,
        copper=copper,
        sink=sinks[0],
        second_sink=sinks[1] if len(sinks) > 1 else "",
        by_speed=by_speed,
        sensors=_sensors(network, nodes, at),
        starts=(),
        effects=_names(network, "effects", at) if network.get("effects") else (),
    )
    form = replace(form, starts=tuple((n, _start_name(n, form, said)) for n in nodes))
    _all_used(said, form, where)
    _connected(form, at)
    return form


def network_text(form: NetworkForm) -> dict[str, Any]:
    """Return the content of the TOML text of a network, which reads back to the same value."""
    network = {
        "name": form.name,
        "title": form.title,
        "nodes": list(form.nodes),
        "sinks": list(form.sinks),
        "links": [list(link) for link, _ in form.resistance],
        "losses": {
            "copper": form.copper,
            "other": _other(form.share),
            **{loss.kind: _other(loss.share) for loss in form.by_speed},
        },
        "by_speed": [loss.kind for loss in form.by_speed],
        "sensors": dict(form.sensors),
        "effects": list(form.effects),
    }
    parameters: dict[str, Any] = {}
    for node, parameter in form.capacitance:
        parameters[parameter.name] = {"capacitance": node, **prior_text(parameter)}
    for link, parameter in form.resistance:
        parameters[parameter.name] = {"resistance": list(link), **prior_text(parameter)}
    for node, share in form.share:
        if isinstance(share, Parameter):
            parameters[share.name] = {"share": node, **prior_text(share)}
    for loss in form.by_speed:
        parameters |= {parameter.name: prior_text(parameter) for parameter in loss.parameters}
    for node, name in form.starts:
        parameters[name] = {"start": node}
    return {"network": network, "parameters": parameters}


def _links(
    network: Mapping[str, Any], nodes: Sequence[str], sinks: Sequence[str], at: str
) -> tuple[Link, ...]:
    links = network.get("links")
    if not isinstance(links, list) or not links:
        raise InputError("expected links between the nodes.", where=at,
                         remedy='Write links = [["winding", "stator"], …].')  # fmt: skip
    result: list[Link] = []
    for link in links:
        is_pair = isinstance(link, list) and len(link) == 2 and link[0] != link[1]
        is_pair = is_pair and not set(link) <= set(sinks)
        if not is_pair or any(end not in (*nodes, *sinks) for end in link):
            raise InputError(
                f"link {link!r:.60}: expected two different names of {[*nodes, *sinks]}, one of "
                "them a node.",
                where=at,
            )
        a, b = (link[1], link[0]) if link[0] in sinks else link
        if (a, b) in result or (b, a) in result:
            raise InputError(f"the link of {a} and {b} is there twice.", where=at)
        result.append((a, b))
    for sink in sinks:
        if len(sinks) > 1 and not any(sink == end for _, end in result):
            raise InputError(
                f"no link leads to the sink {sink}.",
                where=at,
                remedy=f'Add a link such as ["{nodes[-1]}", "{sink}"], or take {sink} out of '
                "sinks.",
            )
    return tuple(result)


def _sensors(
    network: Mapping[str, Any], nodes: Sequence[str], at: str
) -> tuple[tuple[str, str], ...]:
    sensors = network.get("sensors")
    if not isinstance(sensors, dict) or WINDING not in sensors:
        raise InputError(f"expected sensors with {WINDING}.", where=at,
                         remedy=f'Write sensors = {{ {WINDING} = "winding" }}.')  # fmt: skip
    for channel, node in sensors.items():
        if channel not in (WINDING, *BODIES) or node not in nodes:
            raise InputError(
                f"sensors: {channel} = {node!r:.40}; expected a node of {list(nodes)}, by one of "
                f"{', '.join((WINDING, *BODIES))}.",
                where=at,
                remedy=did_you_mean(str(channel), (WINDING, *BODIES)),
            )
    return tuple(sensors.items())


def _connected(form: NetworkForm, at: str) -> None:
    reached, grown = set(form.sinks), True
    while grown:
        more = {n for link, _ in form.resistance if set(link) & reached for n in link} - reached
        reached, grown = reached | more, bool(more)
    apart = [node for node in form.nodes if node not in reached]
    if apart:
        raise InputError(
            f"no path of links leads from {', '.join(apart)} to the sink "
            f"{' or '.join(form.sinks)}: its heat could not leave.",
            where=at,
            remedy=f'Add a link such as ["{apart[0]}", "{form.sink}"].',
        )


def _all_used(said: Mapping[str, Any], form: NetworkForm, where: str) -> None:
    for name in said:
        if name not in form.names:
            raise InputError(
                f"[parameters.{name}] belongs to no node, link, share or start of the network; "
                f"there are {', '.join(form.names)}.",
                where=where,
                remedy=did_you_mean(name, form.names)
                or 'Name what it is the value of: capacitance = "winding", for example.',
            )


def _start_name(node: str, form: NetworkForm, said: Mapping) -> str:
    found = said_of(said, "start", node)
    return found or ("Tw_start" if node == form.measured_node else f"T_{node}_start")


def _names(network: Mapping[str, Any], key: str, at: str) -> tuple[str, ...]:
    names = network.get(key)
    are_names = isinstance(names, list) and all(isinstance(n, str) and n.strip() for n in names)
    if not are_names or not names or len(set(names)) < len(names):
        raise InputError(f"{key}: expected a list of different names, got {names!r:.60}.", where=at)
    for name in names:
        if not name.isidentifier():
            raise InputError(f"{key}: {name!r:.40} is no name of letters, digits and _.", where=at)
    return tuple(names)


def _text(network: Mapping[str, Any], key: str, at: str) -> str:
    value = network.get(key)
    if not isinstance(value, str) or not value.isidentifier():
        raise InputError(f"{key}: expected a name of letters, digits and _, got {value!r:.40}.",
                         where=at)  # fmt: skip
    return value


def _other(shares: Shares) -> Any:
    if len(shares) == 1:
        return shares[0][0]
    if any(isinstance(share, Parameter) for _, share in shares):
        return [node for node, _ in shares]
    return {node: share for node, share in shares if isinstance(share, float)}

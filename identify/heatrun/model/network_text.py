"""The text form of a network: TOML to `NetworkForm` and back, by file or by a built-in name."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from ..errors import InputError, UsageError, did_you_mean
from ..io.toml_text import check_keys, parse_toml
from ..record.channels import BODIES
from .network_form import (
    WINDING,
    Link,
    NetworkForm,
    SpeedLossForm,
    capacitance,
    prior,
    prior_text,
    resistance,
    said_of,
)
from .parameters import Parameter

_SHARE = "equal shares, known to half of that"

SPEED_LOSS = "log-normal, 95 % within a factor of 19: unknown until a test is looked at"
SD_SPEED_LOSS = 1.5
BY_SPEED = ("iron", "mechanical")
"""Kinds of loss that may follow the speed."""

_TERMS = (("n", "the speed"), ("n2", "the square of the speed"))

Shares = tuple[tuple[str, float | Parameter | None], ...]


def losses_of(
    network: Mapping[str, Any],
    nodes: Sequence[str],
    said: Mapping,
    at: str,
    where: str,
    *,
    of: str = "",
) -> tuple[str, Shares]:
    """Return the copper's node, and the shares of the other losses.

    Those under `by_speed` are left out; with `of`, the shares are those of one such kind, and
    their parameters are named after it.
    """
    losses = network.get("losses")
    if isinstance(losses, dict):
        by_speed = network.get("by_speed", [])
        losses = {kind: to for kind, to in losses.items() if kind not in by_speed}
    if not isinstance(losses, dict) or "copper" not in losses or len(losses) < 2:
        raise InputError(
            "expected losses with copper and at least one of other, iron, mechanical.",
            where=at,
            remedy='Write losses = { copper = "winding", other = "stator" }.',
        )
    copper = losses["copper"]
    if copper not in nodes:
        raise InputError(f"losses: copper = {copper!r:.40} names no node of {list(nodes)}.",
                         where=at)  # fmt: skip
    given: dict[str, float] = {}
    heated: list[str] = []
    for kind, target in losses.items():
        if kind == "copper":
            continue
        if not isinstance(target, str | dict) and not (
            isinstance(target, list) and all(isinstance(node, str) for node in target)
        ):
            raise InputError(
                f"losses: {kind} = {target!r:.40}; expected a node, a list of nodes, or shares by "
                "node.",
                where=at,
            )
        if isinstance(target, dict):
            given |= {str(node): share for node, share in target.items()}
            heated += [str(node) for node in target]
        else:
            heated += [target] if isinstance(target, str) else list(target)
    heated = list(dict.fromkeys(heated))
    unknown = [node for node in heated if node not in nodes]
    if unknown or not heated:
        raise InputError(
            f"losses name {', '.join(map(repr, unknown)) or 'no node'}, expected nodes of "
            f"{list(nodes)}.",
            where=at,
        )
    if given:
        numbers = [given.get(node) for node in heated]
        are_numbers = all(isinstance(n, int | float) and not isinstance(n, bool) for n in numbers)
        if not are_numbers or not math.isclose(math.fsum(given.values()), 1.0, abs_tol=1e-9):
            raise InputError(
                "losses: shares are to be given for every heated node and to add up to 1.",
                where=at,
                remedy="Write other = { tooth = 0.5, yoke = 0.5 }, or a list to have the shares "
                "estimated.",
            )
        return copper, tuple((node, float(given[node])) for node in heated)
    if len(heated) == 1:
        return copper, ((heated[0], 1.0),)
    what = f"the {of} loss by speed" if of else "the losses other than copper"
    equal = 1.0 / len(heated)
    shares: list[tuple[str, float | Parameter | None]] = [(heated[0], None)]
    for node in heated[1:]:
        name = f"share_{of}_{node}" if of else said_of(said, "share", node) or f"share_{node}"
        default = Parameter(
            name, "1", f"share of {what} that heats {node}", "network",
            "linear", equal, 0.5 * equal, _SHARE,
        )  # fmt: skip
        at_parameter = f"{where}, [parameters.{name}]"
        shares.append((node, prior(default, said.get(name, {}), at_parameter)))
    return copper, tuple(shares)


def speed_losses(
    network: Mapping[str, Any], nodes: Sequence[str], said: Mapping, at: str, where: str
) -> tuple[SpeedLossForm, ...]:
    """Return the kinds of loss under `by_speed`, with the watts of each and where they go."""
    kinds = network.get("by_speed", [])
    losses = network.get("losses")
    if not isinstance(kinds, list) or any(kind not in BY_SPEED for kind in kinds):
        raise InputError(
            f"by_speed = {kinds!r:.60}; expected a list with iron, mechanical or both.",
            where=at,
            remedy='Write by_speed = ["mechanical"], for example.',
        )
    if not kinds:
        return ()
    if not isinstance(losses, dict) or any(kind not in losses for kind in kinds):
        raise InputError(
            f"by_speed names {', '.join(kinds)}, and losses do not say which node each heats.",
            where=at,
            remedy='Write losses = { copper = "winding", iron = "stator", mechanical = "rotor" }.',
        )
    if not set(losses) - {"copper", *kinds}:
        raise InputError(
            "by_speed names all losses beside the copper's, and none is left to take what they "
            "leave of the measured losses.",
            where=at,
            remedy="Leave one kind out of by_speed: what the losses hold beyond the laws goes "
            'there; or add other = "stator" to losses.',
        )
    found = []
    for kind in dict.fromkeys(kinds):
        alone = {"losses": {"copper": losses.get("copper"), kind: losses[kind]}}
        _, share = losses_of(alone, nodes, said, at, where, of=kind)
        watts = []
        for term, words in _TERMS:
            name = f"P_{kind}_{term}"
            default = Parameter(
                name, "W", f"{kind} loss that grows with {words}, at 1000 rpm", "network",
                "log", 100.0, SD_SPEED_LOSS, SPEED_LOSS,
            )  # fmt: skip
            at_parameter = f"{where}, [parameters.{name}]"
            watts.append(prior(default, said.get(name, {}), at_parameter))
        found.append(SpeedLossForm(kind, watts[0], watts[1], share))
    return tuple(found)


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


BUILT_IN = ("first", "second")
"""Names of the two networks that every bench compares, by growing number of nodes."""

SHIPPED = (*BUILT_IN, "cooled", "three", "four")
"""Names of all networks that come with the package."""


@cache
def _built_in(name: str) -> NetworkForm:
    text = files("heatrun.model") / "networks" / f"{name}.toml"
    return read_network(text.read_bytes(), f"{name}.toml")


def networks_of(words: str) -> tuple[NetworkForm, ...]:
    """Return the networks behind `--model`: `"both"`, or names and files with commas between.

    Raises:
        InputError: As `network_named`.
        UsageError: If no network is named.
    """
    names = BUILT_IN if words == "both" else [word for word in words.split(",") if word.strip()]
    if not names:
        raise UsageError(f"--model names no network: write both, {', '.join(SHIPPED)} or FILE.toml")
    return tuple(network_named(name.strip()) for name in names)


def pair_of(words: str) -> tuple[NetworkForm, NetworkForm]:
    """Return the two networks that are compared, the one with fewer nodes first.

    Args:
        words: As `networks_of`; a single network is set against the second order, and the second
            order against the first.

    Raises:
        InputError: As `network_named`.
        UsageError: If more than two networks are named.
    """
    named = networks_of(words)
    if len(named) == 1:
        other = "first" if named[0].name == "second" else "second"
        named = (*named, network_named(other))
    if len(named) != 2:
        raise UsageError(f"two networks are compared at a time, and --model names {len(named)}")
    one, two = sorted(named, key=lambda form: len(form.nodes))
    return one, two


def network_named(name: str | NetworkForm) -> NetworkForm:
    """Return a network by the name of a built-in one, or from a TOML file.

    Args:
        name: One of `SHIPPED`, a path that ends in `.toml`, or the network itself.

    Raises:
        InputError: If there is no such network, or the file is wrong.
    """
    if isinstance(name, NetworkForm):
        return name
    if name in SHIPPED:
        return _built_in(name)
    path = Path(name)
    if path.suffix == ".toml":
        from ..io.open_file import read_start
        from ..io.toml_text import LARGEST_BYTES

        return read_network(read_start(path, LARGEST_BYTES + 1), str(path))
    raise InputError(
        f"there is no network {name!r}.",
        remedy=f"Name one of {', '.join(SHIPPED)}, or a TOML file with a [network].",
    )

"""A run as a model in Modelica: parts of the standard library for nodes and links, equations for
what the load does to them.

Reference: Modelica Standard Library 4, Modelica.Thermal.HeatTransfer.
"""

import math
import re
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from lptn.effects.base import LOCKED
from lptn.effects.heat_paths import STEFAN_BOLTZMANN

from ..version import __version__
from .c_file import CSource, filled_template
from .laws import INPUTS, Entry, in_comment, links_of, unique

TYPES = {"J/K": "HeatCapacity", "K/W": "ThermalResistance", "Ohm": "Resistance", "W": "Power"}
"""Type in Modelica.Units.SI of each unit."""

KEYWORDS = re.findall(
    r"\w+",
    """
    algorithm and annotation block break class connect connector constant constrainedby der
    discrete each else elseif elsewhen encapsulated end enumeration equation expandable extends
    external false final flow for function if import impure in initial inner input loop model not
    operator or outer output package parameter partial protected public pure record redeclare
    replaceable return stream then time true type when while within Modelica
    """,
)
"""Words that are no names, and that of the library."""

ZERO_K = "273.15"
"""0 degC."""

HEAT, BLOCKS = "Modelica.Thermal.HeatTransfer", "Modelica.Blocks.Interfaces"


def modelica(source: CSource, parameters: Sequence[Entry]) -> bytes:
    """Return the text of a package: the network, and the same at the ends of the intervals.

    Args:
        source: The network as C, of whose numbers the model is made.
        parameters: From `entries`.
    """
    found, nodes, links = source.found, source.nodes, links_of(source.found)
    sinks = [str(found[each]) for each in ("sink", "second_sink") if each in found]
    plain = dict(zip([*nodes, *sinks], unique([*nodes, *sinks], (), "_"), strict=True))
    inputs = [INPUTS[each] for each in source.inputs]
    resistors = list(unique((f"R_{plain[a]}_{plain[b]}" for a, b in links), (), "_"))
    taken = {*KEYWORDS, *inputs, *resistors, "i", "s", "copper_W", "direct_W", "other_W", "stray_W",
             "all_W", "warmed_degC"}  # fmt: skip
    for each in plain.values():
        taken |= {f"C_{each}", f"P_{each}", f"T_{each}", f"{each}_degC", f"{each}_start_degC",
                  f"moved_{each}_W"}  # fmt: skip
    names = list(unique((each.name for each in parameters), taken, "_"))
    by_place = {(e.member, e.index): name for e, name in zip(parameters, names, strict=True)}

    parts = [
        f'parameter {_type(e.unit)} {name} = {e.value!r} "{_text(e.words)}"'
        for e, name in zip(parameters, names, strict=True)
    ]
    parts += [
        f'parameter Real {plain[node]}_start_degC(unit = "degC") = {float(start)!r}'
        for node, start in zip(nodes, np.atleast_1d(found["start"]), strict=True)
    ]
    parts += [f'{BLOCKS}.RealInput {each}(unit = "{_unit(each)}")' for each in inputs]
    parts += [f'{BLOCKS}.RealOutput {plain[node]}_degC(unit = "degC")' for node in nodes]
    equations = []
    for node in nodes:
        C = f"C_{plain[node]}"
        of_node = by_place["capacitance_J_per_K", nodes.index(node)]
        start = f"T(start = {plain[node]}_start_degC + {ZERO_K}, fixed = true)"
        parts.append(f"{HEAT}.Components.HeatCapacitor {C}(C = {of_node}, {start})")
        parts.append(f"{HEAT}.Sources.PrescribedHeatFlow P_{plain[node]}")
        equations.append(f"connect(P_{plain[node]}.port, {C}.port)")
        equations.append(f"{plain[node]}_degC = {C}.T - {ZERO_K}")
    for sink, signal in zip(sinks, ("warmed_degC", "second_sink_degC"), strict=False):
        parts.append(f"{HEAT}.Sources.PrescribedTemperature T_{plain[sink]}")
        equations.append(f"T_{plain[sink]}.T = {signal} + {ZERO_K}")
    of_end = {**{n: f"{plain[n]}_degC" for n in nodes},
              **dict(zip(sinks, ("warmed_degC", "second_sink_degC"), strict=False))}  # fmt: skip
    for i, (pair, R) in enumerate(zip(links, resistors, strict=True)):
        ohm = by_place["resistance_K_per_W", i]
        gains = []
        if g := by_place.get(("speed_gain", i)):
            gains.append(f"(1 + {g}*s^{by_place['speed_exponent', i]})")
        if g := by_place.get(("fan_gain", i)):
            gains.append(f"(1 + {g}*fan)")
        if f := by_place.get(("natural_share", i)):
            theta = f"({of_end[pair[0]]} - {of_end[pair[1]]})"
            n = by_place["natural_exponent", i]
            gains.append(f"(1 - {f} + {f}*(({theta}^2 + 1)/1600)^({n}/2))")
        if b := by_place.get(("warmth_gain_per_K", i)):
            gains.append(f"(1 + {b}*({of_end[pair[0]]} - 60))")
        if gains:
            parts.append(f"{HEAT}.Components.Convection {R}")
            equations.append(f"{R}.Gc = {'*'.join(gains)}/{ohm}")
        else:
            parts.append(f"{HEAT}.Components.ThermalResistor {R}(R = {ohm})")
        for end, port in zip(pair, ("solid", "fluid") if gains else ("port_a", "port_b"),
                             strict=True):  # fmt: skip
            body = f"{'C' if end in nodes else 'T'}_{plain[end]}"
            equations.append(f"connect({R}.{port}, {body}.port)")
    heats = _heats(source, by_place, plain)
    inner = [each.partition(" = ")[0] for each in heats]
    sets = []
    for end, which in enumerate(("lower", "upper")):
        values = [
            f"{name} = {e.interval_95[end]!r}"
            for e, name in zip(parameters, names, strict=True)
            if e.interval_95
        ]
        if values:
            said = f"each parameter at the {which} end of its 95 % interval"
            sets.append(f'model {which.title()} = Network({", ".join(values)})\n    "{said}"')
    return filled_template("network.mo", {
        **{name: in_comment(text) for name, text in source.said.items()},
        "version": __version__,
        "losses_words": source.losses_words,
        "parts": _lines(parts),
        "inner": _lines(f"Real {name}" for name in inner if "." not in name),
        "equations": _lines([*equations, *heats]),
        "sets": "".join(f"\n  {each};\n" for each in sets),
    }).encode("ascii")  # fmt: skip


def _heats(
    source: CSource, by_place: Mapping[tuple[str, int | None], str], plain: Mapping[str, str]
) -> list[str]:
    """Return the equations of the losses, those of the names that they need first.

    Args:
        source: The network as C.
        by_place: Name of each parameter by its member and place there.
        plain: Name of each node and sink.
    """
    found, nodes = source.found, source.nodes
    is_balance = found["losses"] == "balance"
    Rs0, ac, stray, more_ohm, more_B, standby, gain, coolant, recirculation, outside = (
        by_place.get((each, None), "")
        for each in ("Rs0_ohm", "ac_copper", "stray_W", "resistance_gain", "coefficient_more_degC",
                     "standby_W", "loss_gain", "coolant_share", "recirculation_K_per_W",
                     "outside_share")
    )  # fmt: skip
    B, T, phases = (float(found[each]) for each in ("B", "Tref", "phases"))
    copper_node = found["copper_node"]
    hot, members = f"{plain[copper_node]}_degC", {member for member, _ in by_place}
    per_K = f"{phases:g}*{Rs0}*current_A^2/{B + T!r}"
    direct = f"{per_K}*({B!r} + {hot})" if Rs0 else "0"
    terms = [f"{ac}*s^2*({B + T!r}/({B!r} + {hot}))^2" if ac else "", more_ohm]
    copper = "*".join(
        ["direct_W", *([f"(1 + {' + '.join(filter(None, terms))})"] if any(terms) else [])]
    )
    in_overhang = {}
    for (member, i), share in by_place.items():
        if member == "copper_moved" and i is not None and Rs0:
            end = f"{plain[nodes[i]]}_degC"
            copper += f" + {share}*{per_K}*({end} - {hot})"
            in_overhang[i] = f"{share}*{per_K}*({B!r} + {end})"
    if more_B and Rs0:
        copper += f" + {per_K}*{more_B}/({B + T!r} + {more_B})*({T!r} - {hot})"
    equations = []
    if {"speed_gain", "ac_copper", "stray_W", "moved_W", "outside_share"} & members:
        equations.append(f"s = abs(speed_rpm)/{float(found['rated_speed_rpm'])!r}")
    if {"stray_W", "moved_W"} & members:
        equations.append(f"i = current_A/{float(found['rated_current_A'])!r}")
    if stray:
        equations.append(f"stray_W = {stray}*i^2*max(s, {LOCKED})^1.5")
        copper += " + stray_W" if is_balance else ""
    equations += [f"direct_W = {direct}", f"copper_W = {copper}"]
    by_speed = {}
    for i, node in enumerate(nodes):
        terms = [
            f"{by_place[member, i]}*(abs(speed_rpm)/1000)^{power}"
            for member, power in (("speed_loss_W", 1), ("speed_squared_loss_W", 2))
            if (member, i) in by_place
        ]
        by_speed[node] = f"({' + '.join(terms)})" if terms else ""
    moved = {}
    for i, node in enumerate(nodes):
        if P := by_place.get(("moved_W", i)):
            n, m = (by_place.get((f"moved_{of}", i), "0") for of in ("exponent", "by_load"))
            moved[node] = f"moved_{plain[node]}_W"
            of_speed = f"(1 - {m})*(if s > 0 then s^{n} else 0)"
            of_load = f"{m}*i^2*max(s, {LOCKED})^{n}"
            equations.append(f"{moved[node]} = {P}*max({of_speed} + {of_load}, 0)")
    given = "".join(
        ["losses_W", *(f" - {each}" for each in by_speed.values() if each and is_balance)]
    )
    equations.append(f"all_W = {given}{'' if is_balance else ' + direct_W'}")
    other = f"{given}{' - copper_W' if is_balance else ''}"
    other += f" + {gain}*({'all_W' if is_balance else given})" if gain else ""
    other += f" + {standby}" if standby else ""
    if outside:
        m = by_place.get(("outside_exponent", None), "0")
        other += f" - {outside}*(if s > 0 then s^{m} else 0)*(all_W - direct_W)"
    equations.append(f"other_W = {other}")
    air = f"sink_degC + {recirculation}*all_W" if recirculation else "sink_degC"
    mixed = f"(1 - {coolant})*({air}) + {coolant}*coolant_degC" if coolant else air
    equations.append(f"warmed_degC = {mixed}")
    shared = " - ".join(["other_W", *moved.values()])
    shared += " + stray_W" if stray and not is_balance else ""
    shared = f"({shared})" if " " in shared else shared
    for i, (node, share) in enumerate(zip(nodes, np.atleast_1d(found["share"]), strict=True)):
        part = by_place.get(("share", i), repr(float(share)))
        terms = [] if part == "0.0" else [shared if part == "1.0" else f"{part}*{shared}"]
        if node == copper_node:
            terms += ["copper_W", *(f"(-{each})" for each in in_overhang.values())]
        terms += [in_overhang[i]] if i in in_overhang else []
        terms += [each for each in (by_speed[node], moved.get(node)) if each]
        if torque := by_place.get(("friction_Nm", i)):
            fall = by_place.get(("friction_fall_per_K", i), "0")
            fading = f"exp(-{fall}*({plain[node]}_degC - warmed_degC))"
            terms.append(f"{torque}*{math.pi / 30.0!r}*abs(speed_rpm)*{fading}")
        if eA := by_place.get(("radiating_m2", i)):
            hot_K, cold_K = (
                f"({each} + {ZERO_K})" for each in (f"{plain[node]}_degC", "warmed_degC")
            )
            terms.append(f"(-{STEFAN_BOLTZMANN!r}*{eA}*({hot_K}^4 - {cold_K}^4))")
        equations.append(f"P_{plain[node]}.Q_flow = {' + '.join(terms) or '0'}")
    return equations


def _type(unit: str) -> str:
    return f"Modelica.Units.SI.{TYPES[unit]}" if unit in TYPES else "Real"


def _unit(name: str) -> str:
    """Return the unit that the name of an input ends with."""
    return {"fan": "1", "speed_rpm": "rpm"}.get(name, name.rpartition("_")[2])


def _text(words: str) -> str:
    """Return text that stands safely in a string."""
    return " % ".join(in_comment(part) for part in words.split(" % "))


def _lines(statements: Iterable[str]) -> str:
    return "\n".join(f"    {each};" for each in statements)

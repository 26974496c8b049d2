"""Words in column names that make a channel likely: for proposals alone, never for reading.

A built-in map (`heatrun.bench.channels.maps`) decides; what stands here only sorts the columns
that a person is asked about.
"""

from __future__ import annotations

import re

SHORT = r"(?:\b|_)(?:T|Temp|tmp|theta|th|[θϑΘ])[_ .]?"
"""Beginning of a short name of a temperature, such as Tw, T_cu or theta_w."""

NO_COPPER = r".*(?:loss|verl|perd|pert|pérd|mass|resist|widerst|(?<![a-z])P[_ ])"
"""In a name with the word copper: it is no temperature."""

LIKELY: dict[str, re.Pattern[str]] = {
    channel: re.compile(pattern, re.IGNORECASE)
    for channel, pattern in {
        "time_s": r"^t$|time|zeit|tempo|temps|tiempo|elapsed|clock|stamp",
        "end_winding_degC": r"end.?w|overhang|wickelk|testat",
        "winding_degC": r"w(?:i?n?dg|nd)|winding|wickl|coil|avvolg|bobin|enroul|devanad|hot.?spot"
        rf"|{SHORT}(?:s?w(?:[1-9uvw]|ind)?|cu[1-9uvw]?)(?![a-z])(?!.?in(?![a-z]))"
        rf"|^(?!{NO_COPPER}).*(?:copper|kupfer|cuivre|cobre|(?<![a-z])rame(?![a-z]))"
        r"|slot|nut(?![a-z])",
        "ambient_degC": r"amb|room|raum|environ|umg|umluft|\bluft|\bair|\blab|aria|stanza|pi[eè]ce"
        r"|\bT_?(?:e|a|amb|env|0)(?![a-z0-9])",
        "coolant_degC": r"cool|k[üu]hl|water|wasser|inlet|vorlauf|refrig|acqua|\boil|glyk|glyc",
        "housing_degC": r"hous|geh[äa]us|frame|case|carcas",
        "bearing_degC": r"bear|lager|cuscin|palier",
        "magnet_degC": r"magn|\bpm\b",
        "rotor_degC": r"rot(?:or)?(?![a-z])",
        "yoke_degC": r"yoke|joch",
        "tooth_degC": r"tooth|teeth|zahn|z[äa]hn",
        "stator_degC": r"stat|st[äa]nder",
        "controller_degC": r"contr|inv|umrichter|igbt|\besc|heat.?sink",
        "phase_current_A": r"phas|\bI_?(?:s|ph|rms|u|1|eff|mot)(?![a-z])|curr|strom|corr|courant",
        "losses_W": r"loss|verl|perd|perte|dissip|\bP_?(?:d|v|l|loss|tot)(?![a-z])|^P$",
        "speed_rpm": r"speed|drehz|veloc|giri|\bn(?![a-z])|rpm|omega|vitesse",
        "torque_Nm": r"torq|moment|coppia|couple|\bM(?![a-z])|drehm",
        "dc_voltage_V": r"dc|bus|batt|link|zwischenk",
        "dc_current_A": r"dc|bus|batt|link|zwischenk",
        "dc_power_W": r"dc|bus|batt|link|zwischenk",
        "electrical_power_W": r"elec|el\b|\bin\b|input|P_?(?:el|1|in)(?![a-z])|aufn",
        "mechanical_power_W": r"mech|shaft|out|P_?(?:mech|2|out)(?![a-z])|welle|abgab",
        "coolant_flow_L_per_min": r"flow|durchfl|portata|debit",
        "vehicle_speed_km_per_h": r"vehic|fahrz|veicolo|car|road",
        "fan": r"fan|l[üu]fter|vent",
    }.items()
}
"""Pattern of likely names by channel; where several match, the first in this order is proposed."""


def likely_channels(name: str) -> tuple[str, ...]:
    """Return the channels that a column's name makes likely, the likeliest first.

    Args:
        name: As it stands in the file, or without its unit.
    """
    return tuple(channel for channel, pattern in LIKELY.items() if pattern.search(name))


ELECTRICAL_SPEED = re.compile(
    r"(?:^|[^a-z])e[_ .\-]?rpm(?![a-z])|(?:^|[^a-z])(?:omega|w)[_ .]?e(?:l\w*)?(?![a-z])"
    r"|(?:^|[^a-z])(?:el|elec\w*|elek\w*|elett\w*|élec\w*)(?![a-z])"
    r"(?![_ .]*(?:mot|mach|masch|macch))",
    re.IGNORECASE,
)
"""In the name of a speed: that of the field, the shaft's times the pole pairs. An "electric motor
speed" is the shaft's."""

NOT_THE_SHAFTS = (
    "it is the electrical speed: divided by the number of pole pairs, in the file, it is speed_rpm"
)
"""What is missing where a file has the electrical speed alone."""

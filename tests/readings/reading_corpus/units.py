"""What the units of the corpus are worth, written down apart from the package that is tested."""

import math

UNITS: dict[str, dict[str, tuple[float, float]]] = {
    "time": {
        "s": (1, 0), "ms": (1e-3, 0), "us": (1e-6, 0), "ns": (1e-9, 0), "min": (60, 0),
        "h": (3600, 0), "d": (86400, 0), "10ms": (0.01, 0),
    },
    "current": {
        "A": (1, 0), "mA": (1e-3, 0), "kA": (1e3, 0), "uA": (1e-6, 0),
        "cA": (0.01, 0), "A_peak": (1 / math.sqrt(2), 0), "pp": (1 / math.sqrt(8), 0),
    },
    "power": {
        "W": (1, 0), "kW": (1e3, 0), "mW": (1e-3, 0), "MW": (1e6, 0), "hp": (745.69987158227, 0),
        "PS": (735.49875, 0), "kcal/h": (1.163, 0), "daW": (10, 0), "dW": (0.1, 0),
        "hW": (100, 0), "BTU/h": (0.29307107017222, 0), "20%": (20, 0),
    },
    "temperature": {
        "degC": (1, 0), "K": (1, -273.15), "degF": (5 / 9, -160 / 9), "degR": (5 / 9, -273.15),
        "0.1 degC": (0.1, 0), "c°C": (0.01, 0), "mdegC": (1e-3, 0),
        "ohm": (1 / 0.385, -100 / 0.385),
    },
    "speed": {
        "rpm": (1, 0), "krpm": (1e3, 0), "rps": (60, 0), "rad/s": (30 / math.pi, 0),
        "deg/s": (1 / 6, 0),
    },
    "torque": {
        "Nm": (1, 0), "mNm": (1e-3, 0), "kNm": (1e3, 0), "Ncm": (1e-2, 0),
        "lbf ft": (1.3558179483314004, 0), "lbf in": (0.1129848290276167, 0),
        "kgf m": (9.80665, 0), "daNm": (10, 0),
    },
    "voltage": {"V": (1, 0), "mV": (1e-3, 0), "kV": (1e3, 0)},
    "flow": {
        "L/min": (1, 0), "L/h": (1 / 60, 0), "L/s": (60, 0), "m3/h": (1000 / 60, 0),
        "gpm": (3.785411784, 0), "mL/min": (1e-3, 0),
    },
}  # fmt: skip
"""Unit to (factor, offset): canonical = factor * value + offset."""

CHANNELS: dict[str, tuple[str, str, str]] = {
    "time_s": ("time", "s", "time"),
    "phase_current_A": ("current", "A", "phase_current"),
    "losses_W": ("power", "W", "losses"),
    "ambient_degC": ("temperature", "degC", "ambient"),
    "winding_degC": ("temperature", "degC", "winding"),
    "stator_degC": ("temperature", "degC", "stator"),
    "coolant_degC": ("temperature", "degC", "coolant"),
    "speed_rpm": ("speed", "rpm", "speed"),
    "torque_Nm": ("torque", "Nm", "torque"),
    "dc_voltage_V": ("voltage", "V", "dc_voltage"),
    "dc_current_A": ("current", "A", "dc_current"),
    "coolant_flow_L_per_min": ("flow", "L/min", "coolant_flow"),
}
"""Channel to quantity, canonical unit and stem of its name."""

FIVE = ("time_s", "phase_current_A", "losses_W", "ambient_degC", "winding_degC")
SEVEN = (*FIVE, "speed_rpm", "torque_Nm")
DRIVE = (*SEVEN, "dc_voltage_V", "dc_current_A")


def worth(channel: str, unit: str) -> tuple[float, float]:
    """Return factor and offset of a unit for a channel."""
    return UNITS[CHANNELS[channel][0]][unit]

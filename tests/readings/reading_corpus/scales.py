"""Units that nothing states, and files that are no record."""

from collections.abc import Iterator

import numpy as np

from .case import Case, Truth
from .machine import MACHINES
from .table import Layout, Sheet, sheet
from .units import CHANNELS, DRIVE, SEVEN

SCALE, BROKEN = "units that nothing states", "no record"
CAUSE = r"unit|factor|kelvin|fahrenheit|amplitude|peak|rms|1000|\[kW\]|krpm|°F|√2"

# Channel, unit of the numbers, name in the file.
UNSTATED: tuple[tuple[str, str, str], ...] = (
    ("losses_W", "kW", "losses"), ("losses_W", "kW", "Pd"), ("losses_W", "kW", "P_loss"),
    ("losses_W", "mW", "losses"), ("losses_W", "MW", "Pv"), ("losses_W", "hp", "P_loss"),
    ("winding_degC", "K", "winding"), ("winding_degC", "K", "T_w"),
    ("winding_degC", "degF", "winding"), ("winding_degC", "degF", "T_w"),
    ("winding_degC", "0.1 degC", "winding"), ("winding_degC", "mdegC", "T_w"),
    ("ambient_degC", "K", "ambient"), ("ambient_degC", "degF", "ambient"),
    ("ambient_degC", "degF", "T_room"), ("phase_current_A", "mA", "phase_current"),
    ("phase_current_A", "kA", "I"), ("phase_current_A", "A_peak", "phase_current"),
    ("phase_current_A", "A_peak", "I_ph"), ("speed_rpm", "krpm", "speed"),
    ("speed_rpm", "rps", "speed"), ("speed_rpm", "rad/s", "speed"), ("speed_rpm", "rad/s", "omega"),
    ("torque_Nm", "mNm", "torque"), ("torque_Nm", "kNm", "torque"), ("torque_Nm", "Ncm", "M"),
    ("torque_Nm", "lbf ft", "torque"),
)  # fmt: skip


def betrayed(made: Sheet, channel: str, unit: str) -> bool:
    """Whether physics betrays a unit that nothing states.

    With the DC link's power, speed and torque must balance. Without it, only a torque far above
    what losses of this size leave room for is odd; a slow machine with a small torque is none.
    An amplitude shows where its copper loss would exceed the losses. A torque in foot-pounds leaves
    26 % of the power over, which the inverter of a small drive takes: no relation of the file
    tells the two apart.
    """
    true = made.truth
    if unit == "A_peak":
        machine = MACHINES[made.number % len(MACHINES)]
        copper = 6 * true[channel] ** 2 * machine.resistance_ohm
        return bool((copper > 1.1 * true["losses_W"]).mean() > 0.3)
    if unit == "lbf ft":
        return False
    if channel in ("speed_rpm", "torque_Nm"):
        return "dc_voltage_V" in true or unit in ("mNm", "Ncm")
    return True


def scales() -> Iterator[Case]:
    """One quantity in another unit than its channel, and no word about it."""
    STEMS = ("losses", "winding", "ambient", "phase_current", "speed", "torque")
    for number, (channel, unit, name) in enumerate(UNSTATED):
        for turn, channels in enumerate((SEVEN, DRIVE)):
            if turn and channel in ("ambient_degC",):
                continue
            made = sheet(
                number + 2 * turn, rows=300, channels=channels, units={channel: unit},
                headers={channel: name},
            )  # fmt: skip
            columns = {} if name in STEMS else {channel: name}
            truth = Truth.ASK if betrayed(made, channel, unit) else Truth.OPEN
            yield made.case(
                SCALE, f"{channel} in {unit} as {name}, {len(channels)} columns", truth,
                columns=columns, subject=CAUSE,
            )  # fmt: skip
    for number, units in enumerate((
        {"winding_degC": "K", "ambient_degC": "K"},
        {"winding_degC": "degF", "ambient_degC": "degF"},
        {"losses_W": "kW", "phase_current_A": "kA"}, {"losses_W": "mW", "phase_current_A": "mA"},
        {"speed_rpm": "rad/s", "torque_Nm": "kNm"}, {"time_s": "min", "losses_W": "kW"},
        {"time_s": "min", "winding_degC": "K"},
    )):  # fmt: skip
        headers = {c: "t" if c == "time_s" else CHANNELS[c][2] for c in units}
        made = sheet(number, rows=300, channels=SEVEN, units=units, headers=headers)
        truth = Truth.OPEN if "speed_rpm" in units else Truth.ASK
        yield made.case(SCALE, f"two at once: {units}", truth, subject=CAUSE + "|minutes")
    # A name that states a wrong unit is worse than none.
    for number, (channel, unit) in enumerate((
        ("losses_W", "kW"), ("winding_degC", "K"), ("winding_degC", "degF"), ("time_s", "min"),
        ("time_s", "ms"), ("phase_current_A", "mA"), ("phase_current_A", "A_peak"),
    )):  # fmt: skip
        made = sheet(
            number, rows=300, channels=DRIVE, units={channel: unit}, headers={channel: channel}
        )
        yield made.case(SCALE, f"{channel} holds {unit}", Truth.ASK, subject=CAUSE + "|minutes")
    # The machine's own power balance is all that could betray the speed.
    for number in range(4):
        made = sheet(number, rows=300, channels=DRIVE, headers={"losses_W": "losses"})
        yield made.case(SCALE, f"nothing is wrong, machine {number}", Truth.PLAIN)
        made = sheet(number + 8, rows=300, channels=SEVEN)
        bare = {channel: values for channel, values in made.truth.items()}
        yield made.case(SCALE, f"nothing is wrong, seven columns, machine {number}", Truth.PLAIN,
                        channels=bare, has_resistance=False)  # fmt: skip


def broken() -> Iterator[Case]:
    """What is no record, or one in which something is missing."""
    made = sheet(0, rows=60)
    text = made.text()
    lines = text.splitlines(keepends=True)

    def refuse(name: str, content: bytes, suffix: str = ".csv", **more) -> Case:
        return Case(BROKEN, name, Truth.REFUSE, content, suffix, **more)

    yield refuse("empty", b"")
    yield refuse("blank lines alone", b"\n\n\n")
    yield refuse("spaces alone", b"   \n  ")
    yield refuse("header alone", lines[0])
    yield refuse("header and units alone", lines[0] + b"s,A,W,degC,degC\n")
    yield refuse("one sample", b"".join(lines[:2]))
    yield refuse("one column", b"".join(line.split(b",")[0] + b"\n" for line in lines))
    yield refuse("two columns", b"".join(b",".join(line.split(b",")[:2]) + b"\n" for line in lines))
    yield refuse("no names", b"".join(lines[1:]))
    yield refuse("prose", b"The test was cancelled because the pump failed.\n" * 20)
    yield refuse("JSON", b'{"time_s": [0, 1, 2], "losses_W": [1, 2, 3]}')
    yield refuse("XML", b'<?xml version="1.0"?><data><t>0</t></data>')
    yield refuse("HTML", b"<html><table><tr><td>0</td></tr></table></html>")
    yield refuse("an XLSX", b"PK\x03\x04" + b"\0" * 200, ".xlsx")
    yield refuse("an XLS", b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + b"\0" * 600, ".xls")
    yield refuse("an XLSX called CSV", b"PK\x03\x04" + b"\0" * 200)
    yield refuse("a PDF", b"%PDF-1.4\n" + b"x" * 200)
    yield refuse("zeros", b"\0" * 400)
    yield refuse("random bytes", np.random.default_rng(1).bytes(3000))
    yield refuse("time stands still", b"".join(b"0," + line.split(b",", 1)[1] if i else line
                                               for i, line in enumerate(lines)))  # fmt: skip
    yield refuse("time runs backwards", lines[0] + b"".join(reversed(lines[1:])))
    yield refuse("no numbers", lines[0] + b"a,b,c,d,e\n" * 30)
    yield refuse(
        "one name too few", b"time_s,phase_current_A,losses_W,ambient_degC\n" + b"".join(lines[1:])
    )
    yield refuse("truncated HDF5", b"\x89HDF\r\n\x1a\n" + b"\0" * 40, ".h5")
    yield refuse("truncated Parquet", b"PAR1" + b"\0" * 40, ".parquet")
    yield refuse("truncated MDF", b"MDF     4.10    " + b"\0" * 40, ".mf4")
    yield refuse("truncated TDMS", b"TDSm" + b"\0" * 40, ".tdms")
    yield refuse("truncated MATLAB 5", b"MATLAB 5.0 MAT-file".ljust(124) + b"\0\1IM", ".mat")
    yield refuse(
        "winding missing", b"".join(b",".join(line.split(b",")[:4]) + b"\n" for line in lines)
    )
    yield refuse("all cells empty", lines[0] + b",,,,\n" * 40)
    # What is odd and still a record.
    negative = sheet(1, rows=300)
    shifted = negative.with_cells("time_s", lambda cell: f"{float(cell) - 60:.3f}")
    yield shifted.case(BROKEN, "time begins below zero", Truth.PLAIN)
    late = negative.with_cells("time_s", lambda cell: f"{float(cell) + 86400:.3f}")
    yield late.case(BROKEN, "time begins late", Truth.PLAIN)
    cut = negative.text()[:-7]
    truth = {channel: values.copy() for channel, values in negative.truth.items()}
    truth["winding_degC"][-1] = np.nan
    yield negative.case(BROKEN, "the last line is cut off in a number", Truth.ASK, cut,
                        channels=truth, subject="last|cut|end|line")  # fmt: skip
    cut = negative.text().rpartition(b",")[0]
    yield negative.case(BROKEN, "the last line is cut off between cells", Truth.ASK, cut,
                        channels=truth, true_faults=frozenset({"nan_block"}),
                        subject="last|cut|end|line|cells")  # fmt: skip
    swapped = sheet(2, rows=300)
    order = np.arange(300)
    order[[100, 101]] = [101, 100]
    body = swapped.text().splitlines(keepends=True)
    content = body[0] + b"".join(body[1 + i] for i in order)
    yield swapped.case(BROKEN, "two lines exchanged", Truth.ASK, content, subject="time|order|back",
                       channels={c: v[order] for c, v in swapped.truth.items()})  # fmt: skip
    yield sheet(3, rows=300).case(BROKEN, "twice the same line", Truth.ASK,
                                  Layout(rows=lambda lines: lines[:50] + lines[49:]),
                                  subject="time|repeat|twice|duplicate|same")  # fmt: skip

"""A bench that logs a test: rows at a rate, each in pieces of random length, until it is ended.

    python tests/app/bench_writer.py FILE ROWS_PER_S SEED

Row k holds the time k/rate and values that follow from k (`row`), so that a reader can tell whether
what it has is right.
"""

import math
import random
import sys
import time

HEADER = "time_s,phase_current_A,losses_W,ambient_degC,winding_degC,oil_pressure [bar],status\n"
LONGEST_PAUSE_S = 0.02


def row(number: int, rate: float) -> str:
    t = number / rate
    winding = 20.0 + 60.0 * (1.0 - math.exp(-t / 1200.0))
    return f"{t:.3f},{80 + number % 40},{600 + number % 7},21.5,{winding:.4f},{number % 9},ok\n"


def main() -> None:
    path, rate, chance = sys.argv[1], float(sys.argv[2]), random.Random(int(sys.argv[3]))
    begun = time.monotonic()
    with open(path, "w") as file:
        file.write(HEADER)
        number = 0
        while True:
            text = row(number, rate)
            cut = chance.randrange(len(text)) if chance.random() < 0.5 else 0
            if cut:
                file.write(text[:cut])
                file.flush()
                time.sleep(chance.random() * min(LONGEST_PAUSE_S, 0.5 / rate))
            file.write(text[cut:])
            file.flush()
            number += 1
            time.sleep(max(begun + number / rate - time.monotonic(), 0.0))


if __name__ == "__main__":
    main()

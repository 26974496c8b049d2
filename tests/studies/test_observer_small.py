"""A small version of the study of the observer: one machine by its true figures, one test."""

import numpy as np
from c_programs import SAID, needs_compiler
from observer import (
    TESTS,
    WITHIN_S,
    alarms_of,
    bench_drawn,
    compiled,
    cost,
    driven_records,
    jobs,
    judged,
    table,
)
from ordinary_machines import drawn_machine, plain

from heatrun.export import mat_bytes, network_variables
from heatrun.export.c_file import CSource
from heatrun.export.missed import Missed
from heatrun.export.network_course import read_network
from heatrun.model.model import Model
from heatrun.record.motor import Motor
from heatrun.record.record import Record


@needs_compiler
def test_an_observer_of_the_true_figures_holds_its_band_and_tells_every_fault(tmp_path):
    rng = np.random.default_rng(6000)
    machine = plain(drawn_machine("water-jacketed PMSM", rng))
    p, bench = machine.physics, bench_drawn(machine, rng)
    record, *_ = driven_records(machine, bench, [TESTS[:1]], 7200.0, rng, has_speed=False)
    rows = record[0]
    motor = Motor("machine", phase_resistance_ohm=p["ohm"], reference_temperature_degC=20.0)
    names = ("phase_current_A", "losses_W", "ambient_degC", "winding_degC")
    channels = dict(zip(names, rows.T, strict=True))
    variables, _ = network_variables(
        Record("duty", {"time_s": np.arange(len(rows)) * 1.0, **channels}),
        {"Ceq_w": p["C_w"], "Ceq_sr": p["C_s"], "Req_w": 1.0 / p["G_ws"],
         "Req_sr": 1.0 / (p["G_rest"] + p["G_fan"]), "Rs0": p["ohm"], "Tw_start": 40.0,
         "Tsr_start": 40.0},
        motor, Model.of("second", motor, ()), rated_speed=100.0, rated_current=10.0,
    )  # fmt: skip
    course = record[2]
    shaft_W = course["torque"] * course["rpm"] * np.pi / 30.0
    losses = 0.005 * float(np.mean(shaft_W) / np.mean(course["losses"]))  # as declared
    missed = Missed(0.02, 1200.0, bench["noise_K"], bench["noise_s"], 0.0, sensor_K=0.55,
                    sink_K=0.5, share=0.01, losses=losses,
                    resolution_K=bench["digit_K"], answer=losses)  # fmt: skip
    for name, text in CSource.of(read_network(mat_bytes(variables)), missed, SAID).texts().items():
        (tmp_path / name).write_bytes(text)
    spent = cost(tmp_path)
    assert 0.0 < spent["model_ns"] < spent["observer_ns"]
    assert spent["state_bytes"] < 1024
    follow = compiled(tmp_path)
    assert alarms_of(follow(rows, record[1][0, 0], 2.0)[2]) == 0
    found = judged(follow, record, bench, rng)
    assert found["blanked_in_band"] > 0.9  # one sensor: its error is within two sds, or is not
    assert found["wrong_start_in_band"] > 0.9
    assert all(found["told_s"][fault] <= within for fault, within in WITHIN_S.items())


def test_alarms_are_counted_once_each():
    assert alarms_of(np.array([0, 0, 3, 3, 4, 0, 0, 2, 4, 0])) == 2
    assert alarms_of(np.array([3, 3, 0])) == 1


def test_the_table_counts_what_it_says():
    test = {"blanked_in_band": 0.95, "stator_in_band": 0.9, "blanked_sd_K": 0.3,
            "wrong_start_in_band": 0.5,
            "rmse_K": dict.fromkeys(("blanked", "open, same minutes", "read", "open"), 0.25),
            "told_s": {**dict.fromkeys(WITHIN_S, 9), "stuck": None}}  # fmt: skip
    rows = [
        job | {"exported": "as it is", "followed": [test, test], "clean_h": 500.0,
               "false_alarms": place,
               "cost": {"by_hand_ns": 9.0, "model_ns": 300.0 + place, "observer_ns": 1200.0,
                        "state_bytes": 392.0}}
        for place, job in enumerate(jobs(1, 2, 2, 500, ""))
    ]  # fmt: skip
    text = table([*rows, {"seed": 3, "failure": "none"}], 1)
    assert "2 machines of 2 kinds by own code, 1 commands ended with an error" in text
    assert "| blanked winding in its band, nothing hidden | 93…97 % | mean 95.0 %" in text
    assert "| stuck: told within 300 s | ≥ 95 % | 0.0 % (0 of 4) | 0…60 % | **missed** |" in text
    assert "| false alarms, all | ≤ 1 per 1000 h | 1.00 (1 in 1000 h) |" in text
    assert "| effects hidden (1) | as it is | 2 | 0.25 |" in text
    assert "| 2 | 9 … 9 ns | 300 … 301 ns | 1200 … 1200 ns | 392 … 392 bytes |" in text


def test_half_of_the_machines_have_something_hidden():
    listed = jobs(100, 24, 10, 60, "")
    assert len({job["seed"] for job in listed}) == 24
    assert sum(job["is_plain"] for job in listed) == 12

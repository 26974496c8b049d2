"""The simulated bench of `data/synthetic`, which is no part of the packages, for the studies."""

import importlib
import importlib.util
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

NAME = "synthetic_bench"


def bench() -> ModuleType:
    if NAME not in sys.modules:
        folder = Path(__file__).parents[2] / "data" / "synthetic" / "generator"
        spec = importlib.util.spec_from_file_location(NAME, folder / "__init__.py")
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        sys.modules[NAME] = module
        spec.loader.exec_module(module)
    return sys.modules[NAME]


def hidden_bench() -> ModuleType:
    bench()
    return importlib.import_module(f"{NAME}.hidden")


def write_motor(case: Any, folder: Path) -> None:
    machine = case.machine
    (folder / "motor.toml").write_text(
        f'[motor]\nname = "study"\nlosses = "{case.losses}"\n'
        f"rated_speed_rpm = {machine.rated_speed_rpm:.2f}\n[winding]\n"
        f"phase_resistance_ohm = {machine.phase_resistance_ohm:.6g}\n",
        encoding="utf-8",
    )

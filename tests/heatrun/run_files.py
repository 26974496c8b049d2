"""Files of a finished run and of its tests, for tests that spoil them."""

import hashlib
import json

import pandas as pd

CHANNELS = {
    "time_s": "t",
    "phase_current_A": "Is",
    "losses_W": "Pd",
    "ambient_degC": "Te",
    "winding_degC": "Tw_m",
    "speed_rpm": "speed_rpm",
}


def write_csv(record, path):
    pd.DataFrame({CHANNELS[name]: values for name, values in record.channels.items()}).to_csv(
        path, index=False
    )


def edit(path, change):
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))
    manifest_file = path.parent / "manifest.json"
    if path.parent.name == "run" and path != manifest_file:  # as if the run had written it so
        listing = json.loads(manifest_file.read_text())
        listing["files"][path.name] = hashlib.sha256(path.read_bytes()).hexdigest()
        manifest_file.write_text(json.dumps(listing))

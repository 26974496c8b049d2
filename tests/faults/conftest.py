from __future__ import annotations

import sys
from pathlib import Path

# the campaign stands beside its tests as plain scripts
sys.path.insert(0, str(Path(__file__).parent))

"""What the tests of fleets share."""

from __future__ import annotations

import sys
from pathlib import Path

# what several files of tests simulate stands beside them as a plain script
sys.path.insert(0, str(Path(__file__).parent))

from __future__ import annotations

import sys
from pathlib import Path

# the machines stand beside their tests as a plain script
sys.path.insert(0, str(Path(__file__).parent))

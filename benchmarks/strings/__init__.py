"""The measured report on strings: ``python -m benchmarks.strings`` writes docs/strings.md.

The references are the tests' own oracles, so that what the report shows is what the tests guard.
"""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

sys.path.append(str(ROOT / "tests"))

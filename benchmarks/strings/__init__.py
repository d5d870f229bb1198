"""The measured report on strings: ``python -m benchmarks.strings`` writes docs/strings.md.

The references are the tests' oracles, so that the tests guard the report's figures.
"""

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

sys.path.append(str(ROOT / "tests"))

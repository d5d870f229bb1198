"""A hash of the contract, which guards against stale libraries.

A library is stale if it was compiled for another version of the contract.
"""

from __future__ import annotations

import hashlib
import json
from functools import cache

from fantoccini.kernel.contract.codes import CODES
from fantoccini.kernel.contract.constants import CONSTANTS
from fantoccini.kernel.contract.functions import COLUMN, FUNCTIONS
from fantoccini.kernel.contract.quantity import SIZES
from fantoccini.kernel.contract.samples import CONTACT, EVENT, PARTS, SAMPLE, WINCH
from fantoccini.kernel.contract.structures import STRUCTURES


@cache
def digest() -> int:
    """63-bit hash of names, shapes, types, codes and constants, without meanings and units."""
    functions = [
        [f.name, *([[q.name, q.shape] for q in part] for part in (f.arguments, f.results))]
        for f in (*FUNCTIONS.values(), COLUMN)
    ]
    written = (SAMPLE, EVENT, CONTACT, WINCH, PARTS)
    parts = {
        "sizes": list(SIZES),
        "functions": functions,
        "parts": [[[q.name, q.shape] for q in parts] for parts in written],
        "structures": [[s.name, [[f.name, f.type] for f in s.fields]] for s in STRUCTURES],
        "codes": [[c.__name__, [[m.name, m.value] for m in c]] for c in CODES],
        "constants": [[name, float(x).hex()] for name, x in CONSTANTS.items()],
    }
    hashed = hashlib.sha256(json.dumps(parts, sort_keys=True).encode("ascii")).digest()
    return int.from_bytes(hashed[:8], "big") >> 1

"""States of rest of bundled puppets and scenes, to the last bit.

    python -m benchmarks.rests arm2d arm3d crane promenade

Two versions that print the same lines rest alike.
"""

from __future__ import annotations

import hashlib
import sys

import numpy as np

import fantoccini as fan


def main() -> None:
    for name in sys.argv[1:]:
        puppet = getattr(fan.puppets, name)()
        x, digest = puppet.rest(), hashlib.sha256()
        for part in (x.q_D, x.q_K, x.taut):
            digest.update(np.ascontiguousarray(part).tobytes())
        print(f"{name}: {digest.hexdigest()[:16]}")


if __name__ == "__main__":
    main()

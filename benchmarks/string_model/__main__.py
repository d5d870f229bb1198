"""``python -m benchmarks.string_model``: prints the cost of chains of masses and springs."""

from __future__ import annotations

from benchmarks.string_model.report import chain_table
from benchmarks.strings.report import machine

if __name__ == "__main__":
    print(chain_table())
    print(machine().markdown())

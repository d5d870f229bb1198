"""Writes the report of a record with a camera turned by one degree, which chi2 does not show.

    python -m benchmarks.identify.turned PAGE.html [--degrees 1]

The record is that of the arm with three markers, 20 s at 60 Hz with 2 mm of noise and gaps.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np
from benchmarks.identify.cases import arm, record

import fantoccini as fan
from fantoccini.lab.identification.judging import doubts
from fantoccini.output import reports


def turned_record(seen: fan.lab.Record, degrees: float) -> fan.lab.Record:
    """A record seen by a camera that is turned about the y axis."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    columns = dict(seen.columns)
    for marker in seen.markers:
        x, z = (np.asarray(seen.columns[f"{marker.name}.{axis}"]) for axis in "xz")
        columns |= {f"{marker.name}.x": c * x + s * z, f"{marker.name}.z": c * z - s * x}
    return replace(seen, columns=columns, name="a camera that is turned")


def main() -> None:
    """Identifies, prints the errors of the parameters, and writes the report."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("page")
    parser.add_argument("--degrees", type=float, default=1.0)
    arguments = parser.parse_args()
    case = arm()
    identified = fan.identify(turned_record(record(case, 20.0, 3, gaps=0.1), arguments.degrees))
    for name, value, deviation in zip(
        identified.names, identified.values, identified.deviations, strict=True
    ):
        off = (value - case.truth[name]) / deviation
        print(f"{name:20s} {value:10.5g}, truth {case.truth[name]:8.5g}: {off:+.1f} deviations")
    print(f"chi2 {identified.chi2:.2f}, drift {identified.drift:.2f}")
    print(*doubts(identified), sep="\n")
    reports.identified_report(identified, arguments.page)


if __name__ == "__main__":
    main()

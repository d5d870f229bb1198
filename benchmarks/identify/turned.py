"""The report of a record whose camera is turned by one degree, which chi2 does not show.

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


def turned(one: fan.lab.Record, degrees: float) -> fan.lab.Record:
    """A record seen by a camera that is turned about the y axis."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    columns = dict(one.columns)
    for marker in one.markers:
        x, z = (np.asarray(one.columns[f"{marker.name}.{axis}"]) for axis in "xz")
        columns |= {f"{marker.name}.x": c * x + s * z, f"{marker.name}.z": c * z - s * x}
    return replace(one, columns=columns, name="a camera that is turned")


def main() -> None:
    """Identifies, prints how far off the numbers are, and writes the report."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("page")
    parser.add_argument("--degrees", type=float, default=1.0)
    given = parser.parse_args()
    case = arm()
    found = fan.identify(turned(record(case, 20.0, 3, gaps=0.1), given.degrees))
    for name, value, deviation in zip(found.names, found.values, found.deviations, strict=True):
        off = (value - case.truth[name]) / deviation
        print(f"{name:20s} {value:10.5g}, truth {case.truth[name]:8.5g}: {off:+.1f} deviations")
    print(f"chi2 {found.chi2:.2f}, drift {found.drift:.2f}")
    print(*doubts(found), sep="\n")
    reports.identified_report(found, given.page)


if __name__ == "__main__":
    main()

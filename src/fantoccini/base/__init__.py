"""Errors and statuses, arrays, rotations, polynomials, files, progress: for every package.

Names end in D for dynamic coordinates, which move by the equations of motion, and in K for driven
ones, given as functions of time: ConfigD and ConfigK are arrays of coordinates, VecD and VecK of
velocities. MaskRows is a mask of rows: strings and joint limits. `ARRIVED` are the statuses of runs
that reached their end, `UNSOUND` those of runs whose results are wrong. A mistake is an error in a
file, with its line; an outcome is the status of a search.
"""

from fantoccini.base import interpolate, npz, polynomial, riccati, rotation, tangent
from fantoccini.base.arrays import (
    Array,
    ConfigD,
    ConfigK,
    Indices,
    Mask,
    MaskRows,
    Quaternion,
    Times,
    Vec3,
    VecD,
    VecK,
    check_not_negative,
    check_positive,
    floats,
    frozen,
    is_number,
    read_only,
)
from fantoccini.base.datagrams import AddressError, ManyHearersError, socket_at, socket_to
from fantoccini.base.drawing import output
from fantoccini.base.errors import (
    ARRIVED,
    UNSOUND,
    BuildError,
    ExchangeError,
    FantocciniError,
    FileError,
    InputError,
    MissingLibraryError,
    Mistake,
    Outcome,
    PacketError,
    PictureError,
    PuppetError,
    SimulationError,
    StandError,
    StateError,
    Status,
    StoreError,
    StreamError,
    SweepStopped,
    UnknownNameError,
    did_you_mean,
)
from fantoccini.base.files import decoded, lines_of, replacing, write_table
from fantoccini.base.hanging import catenary
from fantoccini.base.interpolate import IndexPairs
from fantoccini.base.media import MediaError, ffmpeg, sound_duration, sound_input
from fantoccini.base.nonnegative import nonnegative_least_squares
from fantoccini.base.osc import osc_library
from fantoccini.base.polynomial import N_COEF, shifted
from fantoccini.base.progress import OnProgress, Progress, progress_bar, reporting
from fantoccini.base.rotation import exp, multiply
from fantoccini.base.short_repr import ShortRepr
from fantoccini.base.tangent import moved
from fantoccini.base.vectors import cross, perpendicular, unit

__all__ = [
    "ARRIVED",
    "N_COEF",
    "UNSOUND",
    "AddressError",
    "Array",
    "BuildError",
    "ConfigD",
    "ConfigK",
    "ExchangeError",
    "FantocciniError",
    "FileError",
    "IndexPairs",
    "Indices",
    "InputError",
    "ManyHearersError",
    "Mask",
    "MaskRows",
    "MediaError",
    "MissingLibraryError",
    "Mistake",
    "OnProgress",
    "Outcome",
    "PacketError",
    "PictureError",
    "Progress",
    "PuppetError",
    "Quaternion",
    "ShortRepr",
    "SimulationError",
    "StandError",
    "StateError",
    "Status",
    "StoreError",
    "StreamError",
    "SweepStopped",
    "Times",
    "UnknownNameError",
    "Vec3",
    "VecD",
    "VecK",
    "catenary",
    "check_not_negative",
    "check_positive",
    "cross",
    "decoded",
    "did_you_mean",
    "exp",
    "ffmpeg",
    "floats",
    "frozen",
    "interpolate",
    "is_number",
    "lines_of",
    "moved",
    "multiply",
    "nonnegative_least_squares",
    "npz",
    "osc_library",
    "output",
    "perpendicular",
    "polynomial",
    "progress_bar",
    "read_only",
    "replacing",
    "reporting",
    "riccati",
    "rotation",
    "shifted",
    "socket_at",
    "socket_to",
    "sound_duration",
    "sound_input",
    "tangent",
    "unit",
    "write_table",
]

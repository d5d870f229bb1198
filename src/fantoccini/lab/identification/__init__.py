"""Identification: estimates of a puppet's numbers from records of its motion.

A record is measurements of a puppet in motion under known inputs, and a channel one measured
number: a coordinate of a marker, a joint coordinate or a tension. The unknowns theta are numbers of
the puppet file. A segment is a piece of a record that is simulated from its own first state; the
jump is the difference between this state and the end of the previous segment, and the drift the
standard deviation allowed for jumps. A detached segment has a jump far larger than the others. q_D
are the dynamic coordinates of the puppet and q_K the driven ones (ends and lengths of strings), v_D
and v_K their velocities.
"""

from fantoccini.lab.identification.channels import Marker
from fantoccini.lab.identification.estimating import identify
from fantoccini.lab.identification.judging import (
    biased_jumps,
    column_fits,
    doubts,
    jump_names,
    prior_shares,
)
from fantoccini.lab.identification.record import Record, Unknown
from fantoccini.lab.identification.record_file import load_record, record_files
from fantoccini.lab.identification.result import (
    OUTLIER_RESIDUAL,
    Combination,
    IdentificationResult,
    Outlier,
)
from fantoccini.lab.identification.schema import record_schema
from fantoccini.lab.identification.suggesting import Candidate, suggest_motion
from fantoccini.lab.identification.unit_names import channel_units, units

__all__ = [
    "OUTLIER_RESIDUAL",
    "Candidate",
    "Combination",
    "IdentificationResult",
    "Marker",
    "Outlier",
    "Record",
    "Unknown",
    "biased_jumps",
    "channel_units",
    "column_fits",
    "doubts",
    "identify",
    "jump_names",
    "load_record",
    "prior_shares",
    "record_files",
    "record_schema",
    "suggest_motion",
    "units",
]

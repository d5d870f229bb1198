"""Identification: the numbers of a puppet from records of its motion."""

from fantoccini.identification.channels import Marker
from fantoccini.identification.estimating import identify
from fantoccini.identification.record import Record, Unknown
from fantoccini.identification.record_file import load_record
from fantoccini.identification.result import Combination, Identified, Outlier
from fantoccini.identification.schema import record_schema
from fantoccini.identification.suggesting import Candidate, suggest_motion

__all__ = [
    "Candidate",
    "Combination",
    "Identified",
    "Marker",
    "Outlier",
    "Record",
    "Unknown",
    "identify",
    "load_record",
    "record_schema",
    "suggest_motion",
]

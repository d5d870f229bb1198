"""The names of the package, and where each is defined."""

from . import identification as identification, sweeps as sweeps
from .identification import (
    IdentificationResult as IdentificationResult,
    Marker as Marker,
    Record as Record,
    Unknown as Unknown,
    identify as identify,
    load_record as load_record,
    suggest_motion as suggest_motion,
)
from .reduction import (
    Claim as Claim,
    ReductionReport as ReductionReport,
    validate_reduction as validate_reduction,
)
from .sweeps import Case as Case, SweepResult as SweepResult, Trial as Trial, sweep as sweep

"""The names of the package, and where each is defined."""

from . import (
    build as build,
    codegen as codegen,
    contract as contract,
    equations as equations,
    runtime as runtime,
)

"""A puppet's compiled libraries: each from the cache, or made when it is first needed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TypeVar

from fantoccini import build, codegen, equations
from fantoccini.errors import BuildError
from fantoccini.marionette.mass_check import check_mass_matrix
from fantoccini.runtime import (
    BatchLibrary,
    ClearanceLibrary,
    Functions,
    Library,
    Loaded,
    MotionLibrary,
)
from fantoccini.tree import Tree
from fantoccini.world import World

L = TypeVar("L")

_SHAPING = ("fantoccini.tree.construction", "fantoccini.codegen.libraries")
"""Modules that turn a puppet into source text."""


@dataclass(frozen=True, eq=False)
class Compiled:
    """Equations and libraries of a world; all its models share them, whatever their parameters.

    Each property is derived and compiled, or read from the cache, when it is first asked for.

    Attributes:
        world: the puppets.
        tree: their links, strings, limits and coordinates.
        progress: told what takes long while it happens ("deriving", "compiling").

    Raises:
        BuildError: by each property: no compiler, or it failed.
        PuppetError: by each property: the mass matrix is singular.
    """

    world: World
    tree: Tree
    progress: Callable[[str], None] | None = None

    @cached_property
    def equations(self) -> equations.Equations:
        """The symbolic equations and the functions made from them."""
        return equations.derive(self.tree)

    @cached_property
    def library(self) -> Library:
        """The model and its event-driven and time-stepping runs."""
        return self._library("model", lambda file: Library(file, self.tree))

    @cached_property
    def lanes(self) -> BatchLibrary:
        """The time-stepper for many trajectories in lanes."""
        return self._library("lanes", self._lanes)

    @cached_property
    def clearances(self) -> ClearanceLibrary:
        """Distances from obstacles."""
        return self._library("clearance", lambda file: ClearanceLibrary(file, self.tree.sizes))

    @cached_property
    def motions(self) -> MotionLibrary:
        """The motions of planners."""
        return self._library("motions", lambda file: MotionLibrary(file, self.tree.sizes))

    @cached_property
    def variational(self) -> Library:
        """The variational integrator, for single runs."""
        return self._library("variational", lambda file: Library(file, self.tree))

    @cached_property
    def variational_lanes(self) -> BatchLibrary:
        """The variational integrator of batches."""
        return self._library("variational_lanes", self._lanes)

    @cached_property
    def derivatives(self) -> Functions:
        """The derivatives of the model."""
        return self._library("derivatives", lambda file: Functions(file, self.tree.sizes))

    def batch_library_of(self, method: str) -> BatchLibrary:
        """The library that makes batches of runs of a method."""
        if method == "event":
            return BatchLibrary(self.library)
        return self.lanes if method == "timestepping" else self.variational_lanes

    def library_of(self, method: str) -> Library:
        """The library that makes runs of a method."""
        return self.variational if method == "variational" else self.library

    def source(self, what: str = "model") -> build.Source:
        """The text that a library of this puppet is compiled from."""
        check_mass_matrix(self.world, self.tree)
        made = codegen.generate(self.equations, what)
        return build.Source(made.files, made.main, {"operations": made.operations}, made.units)

    def _lanes(self, file: Path) -> BatchLibrary:
        return BatchLibrary(Loaded(file, self.tree.sizes))

    def _library(self, what: str, load: Callable[[Path], L]) -> L:
        """A library of this puppet, from the cache or made now: one of ``contract.LIBRARIES``."""
        # Values of parameters are arguments of every function: nothing that is compiled has them.
        canonical = "\n".join(p.canonical(values=False) for p in self.world.puppets)
        key = build.fingerprint(canonical, build.code_fingerprint(*_SHAPING), flags=(what,))

        def source() -> build.Source:
            return self.source(what)

        folder = build.obtain(key, source, progress=self.progress)
        try:
            return load(folder / build.LIBRARY)
        except BuildError:
            folder = build.obtain(key, source, progress=self.progress, afresh=True)
            return load(folder / build.LIBRARY)

"""A puppet's compiled libraries, each loaded from the cache or built when first needed.

A library is compiled C++ code of one puppet. Lanes are runs that the vector unit of the processor
advances together.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from fantoccini.base import BuildError, OnProgress
from fantoccini.dynamics.compiled.mass_check import check_mass_matrix
from fantoccini.dynamics.compiled.touching import solids_of_shapes
from fantoccini.kernel import build
from fantoccini.kernel.runtime import (
    BatchLibrary,
    ClearanceLibrary,
    DerivativeLibrary,
    Functions,
    GradientLibrary,
    Library,
    Loaded,
    ReachLibrary,
    RolloutLibrary,
    StepDerivatives,
)
from fantoccini.model.puppet import Puppet
from fantoccini.model.tree import Tree

if TYPE_CHECKING:
    from fantoccini.kernel.equations import Equations

L = TypeVar("L")

SOURCE_MODULES = ("fantoccini.model.tree.construction", "fantoccini.kernel.codegen.libraries")
"""Modules that turn a puppet into source text."""


@dataclass(frozen=True, eq=False)
class Libraries:
    """Equations and libraries of a puppet, shared by its models for all parameters.

    Attributes:
        puppet: puppet as described by its file.
        tree: its links, strings, limits and coordinates.
        progress: callback for each stage that begins (``what``: "deriving", "compiling").

    Raises:
        BuildError: no compiler, or it failed, on access to a library.
        PuppetError: the mass matrix is singular, on access to a library.
    """

    puppet: Puppet
    tree: Tree
    progress: OnProgress | None = None

    @cached_property
    def solids(self) -> tuple[int, ...]:
        """Number of solids of each shape of the links, in order: the size of compiled arrays."""
        return solids_of_shapes(self.puppet.expanded(), self.tree)

    @cached_property
    def tree_with_solids(self) -> Tree:
        """The tree, with the number of these solids."""
        n_extra_solids = sum(self.solids) - len(self.solids)
        return (
            dataclasses.replace(self.tree, n_pieces=n_extra_solids) if n_extra_solids else self.tree
        )

    @cached_property
    def equations(self) -> Equations:
        """The symbolic equations and the CasADi functions made from them."""
        from fantoccini.kernel.equations import derive  # cached puppets derive nothing

        return derive(self.tree_with_solids)

    @cached_property
    def library(self) -> Library:
        """The model and its event-driven and time-stepping runs."""
        return self._library("model", lambda file: Library(file, self.tree_with_solids))

    @cached_property
    def lanes(self) -> BatchLibrary:
        """The time-stepper for many trajectories in lanes."""
        return self._library("lanes", self._lanes)

    @cached_property
    def clearances(self) -> ClearanceLibrary:
        """Library of distances from obstacles."""
        return self._library(
            "clearance", lambda file: ClearanceLibrary(file, self.tree_with_solids.sizes)
        )

    @cached_property
    def rollouts(self) -> RolloutLibrary:
        """Library of rollouts for planners."""
        return self._library(
            "rollouts", lambda file: RolloutLibrary(file, self.tree_with_solids.sizes)
        )

    @cached_property
    def variational(self) -> Library:
        """The variational integrator, for single runs."""
        return self._library("variational", lambda file: Library(file, self.tree_with_solids))

    @cached_property
    def variational_lanes(self) -> BatchLibrary:
        """The variational integrator of batches."""
        return self._library("variational_lanes", self._lanes)

    @cached_property
    def derivatives(self) -> DerivativeLibrary:
        """The derivatives of the model, and of the smooth pieces of event-driven runs."""
        load = DerivativeLibrary
        return self._library("derivatives", lambda file: load(file, self.tree_with_solids.sizes))

    @cached_property
    def step_derivatives(self) -> StepDerivatives:
        """The derivatives of time steps."""
        load = StepDerivatives
        return self._library(
            "step_derivatives", lambda file: load(file, self.tree_with_solids.sizes)
        )

    @cached_property
    def gradients(self) -> GradientLibrary:
        """Library of time-stepped rollouts with gradients of their costs."""
        return self._library(
            "gradients", lambda file: GradientLibrary(file, self.tree_with_solids.sizes)
        )

    @cached_property
    def variational_derivatives(self) -> Functions:
        """The derivatives of the discrete Euler-Lagrange equations."""
        return self._library(
            "variational_derivatives", lambda file: Functions(file, self.tree_with_solids.sizes)
        )

    @cached_property
    def reach(self) -> ReachLibrary:
        """Library of the hanging poses nearest to given places."""
        return self._library("reach", lambda file: ReachLibrary(file, self.tree_with_solids.sizes))

    def batch_library_of(self, method: str) -> BatchLibrary:
        """The library for batches of a method."""
        if method == "event":
            return BatchLibrary(self.library)
        return self.lanes if method == "timestepping" else self.variational_lanes

    def library_of(self, method: str) -> Library:
        """The library for single runs of a method."""
        return self.variational if method == "variational" else self.library

    def source_files(self, library: str = "model") -> build.Source:
        """The source files of a library of this puppet."""
        from fantoccini.kernel import codegen  # cached puppets generate nothing

        check_mass_matrix(self.puppet, self.tree)
        code = codegen.generate(self.equations, library)
        metadata = {"operations": code.operations}
        caching = {"units": code.units, "pieces": code.pieces, "shared_units": code.shared_units}
        return build.Source(code.files, code.main, metadata, **caching)

    def early_objects(self, library: str) -> dict[str, build.Source]:
        """The objects of :meth:`source_files` that do not depend on the equations of motion."""
        from fantoccini.kernel import codegen

        check_mass_matrix(self.puppet, self.tree)
        code = codegen.generate_main(self.equations, library)
        return build.early_objects(code.files, code.main, code.shared_units)

    def _lanes(self, file: Path) -> BatchLibrary:
        return BatchLibrary(Loaded(file, self.tree_with_solids.sizes))

    def _library(self, name: str, load: Callable[[Path], L]) -> L:
        """A library of ``contract.LIBRARIES``, from the cache or built now."""
        # Values of parameters are arguments of every function, and not compiled in.
        canonical = self.puppet.canonical(values=False)
        n_extra_solids = self.tree_with_solids.n_pieces
        flags = (name, f"{n_extra_solids} more solids") if n_extra_solids else (name,)
        key = build.fingerprint(canonical, build.code_fingerprint(*SOURCE_MODULES), flags=flags)

        def library_file(rebuild: bool = False) -> Path:
            folder = build.obtain(
                key,
                partial(self.source_files, name),
                early=partial(self.early_objects, name),
                progress=self.progress,
                rebuild=rebuild,
            )
            return folder / build.LIBRARY

        try:
            return load(library_file())
        except BuildError:
            return load(library_file(rebuild=True))

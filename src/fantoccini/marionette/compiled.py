"""A puppet's compiled libraries: each from the cache, or made when it is first needed."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import Any

from fantoccini import build, codegen, equations
from fantoccini.errors import BuildError
from fantoccini.runtime import BatchLibrary, ClearanceLibrary, Library, Loaded, MotionLibrary
from fantoccini.tree import Tree
from fantoccini.world import World

_SHAPING = ("fantoccini.tree.construction", "fantoccini.codegen.libraries")
"""Modules that turn a puppet into source text."""


class Compiled:
    """The part of a marionette that is compiled."""

    world: World
    tree: Tree
    check_mass_matrix: Callable[[], None]
    _progress: Callable[[str], None] | None

    @cached_property
    def equations(self) -> equations.Equations:
        """The symbolic equations and the functions made from them."""
        return equations.derive(self.tree)

    @cached_property
    def library(self) -> Library:
        """The compiled model, from the cache or made now.

        Raises:
            BuildError: no compiler, or it failed.
            PuppetError: the mass matrix is singular.
        """
        return self._compiled("model", lambda file: Library(file, self.tree))

    @cached_property
    def lanes(self) -> BatchLibrary:
        """The compiled time-stepper for many trajectories side by side; made when first needed.

        Raises:
            BuildError: no compiler, or it failed.
            PuppetError: the mass matrix is singular.
        """
        return self._compiled("lanes", self._lanes)

    @cached_property
    def clearances(self) -> ClearanceLibrary:
        """The compiled distances from obstacles; made when first needed.

        Raises:
            BuildError: no compiler, or it failed.
            PuppetError: the mass matrix is singular.
        """
        return self._compiled(
            "clearance", lambda file: ClearanceLibrary(file, self.tree.sizes)
        )

    @cached_property
    def motions(self) -> MotionLibrary:
        """The compiled motions of planners; made when first needed.

        Raises:
            BuildError: no compiler, or it failed.
            PuppetError: the mass matrix is singular.
        """
        return self._compiled("motions", lambda file: MotionLibrary(file, self.tree.sizes))

    @cached_property
    def variational(self) -> Library:
        """The compiled variational integrator, for runs alone; made when first needed.

        Raises:
            BuildError: no compiler, or it failed.
            PuppetError: the mass matrix is singular.
        """
        return self._compiled("variational", lambda file: Library(file, self.tree))

    @cached_property
    def variational_lanes(self) -> BatchLibrary:
        """The compiled variational integrator of batches; made when first needed.

        Raises:
            BuildError: no compiler, or it failed.
            PuppetError: the mass matrix is singular.
        """
        return self._compiled("variational_lanes", self._lanes)

    def batch_library_of(self, method: str) -> BatchLibrary:
        """The library that makes batches of runs of a method."""
        if method == "event":
            return BatchLibrary(self.library)
        return self.lanes if method == "timestepping" else self.variational_lanes

    def library_of(self, method: str) -> Library:
        """The library that makes runs of a method."""
        return self.variational if method == "variational" else self.library

    def compile(self) -> None:
        """Loads the compiled model, or makes it, before anything needs it."""
        _ = self.library

    def _lanes(self, file: Path) -> BatchLibrary:
        return BatchLibrary(Loaded(file, self.tree.sizes))

    def _compiled(self, what: str, load: Callable[[Path], Any]) -> Any:
        """A library of this puppet, from the cache or made now: one of ``contract.LIBRARIES``."""
        # Values of parameters are arguments of every function: nothing that is compiled has them.
        canonical = "\n".join(p.canonical(values=False) for p in self.world.puppets)
        key = build.fingerprint(canonical, build.code_fingerprint(*_SHAPING), flags=(what,))

        def source() -> build.Source:
            return self.source(what)

        folder = build.obtain(key, source, progress=self._progress)
        try:
            return load(folder / build.LIBRARY)
        except BuildError:
            folder = build.obtain(key, source, progress=self._progress, afresh=True)
            return load(folder / build.LIBRARY)

    def source(self, what: str = "model") -> build.Source:
        """The text that a library of this puppet is compiled from.

        Raises:
            PuppetError: the mass matrix is singular.
        """
        self.check_mass_matrix()
        made = codegen.generate(self.equations, what)
        return build.Source(made.files, made.main, {"operations": made.operations}, made.units)

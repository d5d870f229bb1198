"""A crew of Ray workers: other processes of this machine, or of a cluster."""

from __future__ import annotations

import logging
import os
from typing import Any

from fantoccini.runtime import default_threads
from fantoccini.sweeps.case import Case
from fantoccini.sweeps.crew import Report
from fantoccini.sweeps.outcome import Failure, Job, Outcome

_OBJECT_STORE = 200_000_000
"""Memory for results on their way, of a cluster that is started [B]; what is more goes to disk."""


class RayCrew:
    """Ray workers. A cluster is joined where there is one, and otherwise started on this machine.

    Ray carries the study and the puppets to every worker process once; a puppet is compiled once on
    a machine, since processes share its cache and wait for one another there.

    Args:
        job: what to run.
        workers: most cases at a time; as many as the cluster has processors when None.
        address: of a cluster, as ``ray.init`` takes it.
    """

    piece = 0.5

    def __init__(self, job: Job, workers: int | None, address: str | None):
        try:
            import ray
        except ImportError:
            raise ImportError(
                "on='ray' needs Ray, which is not installed: pip install 'fantoccini[ray]'"
            ) from None
        self._ray = ray
        self._ours = not ray.is_initialized()
        if self._ours:
            join(ray, workers, address)
        self._bound = workers
        self._pending: dict[Any, tuple[Case, ...]] = {}

        # Ray ships the function with what it closes over, once to a process.
        def perform(cases: tuple[Case, ...]) -> list[Outcome]:
            return [job.perform(case) for case in cases]

        self._perform = ray.remote(num_cpus=1, max_retries=0)(perform)

    @property
    def room(self) -> int:
        """Pieces that may be out; follows a cluster that grows.

        With fewer workers than processors none waits: Ray would run it at once.
        """
        found = int(self._ray.cluster_resources().get("CPU", 1)) or 1
        return 2 * found if self._bound is None or self._bound >= found else self._bound

    @property
    def busy(self) -> int:
        """Pieces submitted and not collected."""
        return len(self._pending)

    def submit(self, cases: tuple[Case, ...]) -> None:
        """As :meth:`Crew.submit`."""
        self._pending[self._perform.remote(cases)] = cases

    def collect(self, patience: float) -> list[Report]:
        """As :meth:`Crew.collect`."""
        waiting = list(self._pending)
        ready, _ = self._ray.wait(waiting, num_returns=1, timeout=patience)
        if ready:
            ready, _ = self._ray.wait(waiting, num_returns=len(waiting), timeout=0)
        return [self._report(reference) for reference in ready]

    def close(self) -> None:
        """As :meth:`Crew.close`; a cluster that the sweep started ends too."""
        for reference in self._pending:
            self._ray.cancel(reference, force=True)
        self._pending.clear()
        if self._ours:
            self._ray.shutdown()

    def _report(self, reference: Any) -> Report:
        cases = self._pending.pop(reference)
        try:
            return cases, self._ray.get(reference)
        except self._ray.exceptions.RayTaskError as error:
            # Raised around the cases, not in one: the study could not be brought to the worker.
            failure = Failure("RayTaskError", str(error.cause or error), str(error))
            return cases, [Outcome({}, 0.0, failure) for _ in cases]
        except self._ray.exceptions.RayError:
            return cases, None


def join(ray: Any, workers: int | None, address: str | None) -> None:
    """Joins a cluster, or starts one here that has no dashboard, says little, reports nothing.

    Args:
        ray: the module.
        workers: processors of a cluster that is started; all of this machine when None.
        address: of a cluster; when None that of ``RAY_ADDRESS``, and without it one is started.
    """
    options: dict[str, Any] = {"logging_level": logging.ERROR, "log_to_driver": False}
    if address is not None or os.environ.get("RAY_ADDRESS"):
        ray.init(address=address, **options)
        return
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    ray.init(
        num_cpus=workers or default_threads(),
        include_dashboard=False,
        object_store_memory=_OBJECT_STORE,
        **options,
    )

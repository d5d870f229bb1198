"""An executor on Ray: worker processes on this machine or on a cluster.

An executor runs the cases of a sweep, each one combination of values.
"""

from __future__ import annotations

import logging
import os
from typing import Any

from fantoccini.base import MissingLibraryError
from fantoccini.kernel.runtime import default_threads
from fantoccini.lab.sweeps.case import Case
from fantoccini.lab.sweeps.executors import CompletedTask
from fantoccini.lab.sweeps.outcome import Failure, Job, Outcome

_OBJECT_STORE_BYTES = 200_000_000
"""Shared memory of a cluster started here; results beyond it spill to disk."""


class RayExecutor:
    """Ray workers. Joins a cluster if there is one; otherwise starts one on this machine.

    Ray ships the study and the puppets to every worker process once. A puppet is compiled once per
    machine: its processes share the cache and wait for one another there.

    Args:
        job: study and puppets.
        workers: largest number of cases at a time; one per processor of the cluster when None.
        address: address of a cluster, as for ``ray.init``.
    """

    task_seconds = 0.5

    def __init__(self, job: Job, workers: int | None, address: str | None):
        try:
            import ray
        except ImportError:
            raise MissingLibraryError("on='ray'", "Ray", "ray") from None
        self._ray = ray
        self._owns_cluster = not ray.is_initialized()
        if self._owns_cluster:
            connect(ray, workers, address)
        self._workers = workers
        self._tasks: dict[Any, tuple[Case, ...]] = {}

        # Ray ships the function with its closure once per process.
        def run(cases: tuple[Case, ...]) -> list[Outcome]:
            return [job.run(case) for case in cases]

        self._run = ray.remote(num_cpus=1, max_retries=0)(run)

    @property
    def capacity(self) -> int:
        """Largest number of pending tasks; follows a cluster that grows.

        With fewer workers than processors no task may wait, as Ray would run it at once.
        """
        processors = int(self._ray.cluster_resources().get("CPU", 1)) or 1
        if self._workers is not None and self._workers < processors:
            return self._workers
        return 2 * processors

    @property
    def pending(self) -> int:
        """Number of tasks submitted and not collected."""
        return len(self._tasks)

    def submit(self, cases: tuple[Case, ...]) -> None:
        """See :meth:`Executor.submit`."""
        self._tasks[self._run.remote(cases)] = cases

    def collect(self, timeout: float) -> list[CompletedTask]:
        """See :meth:`Executor.collect`."""
        tasks = list(self._tasks)
        ready, _ = self._ray.wait(tasks, num_returns=1, timeout=timeout)
        if ready:
            ready, _ = self._ray.wait(tasks, num_returns=len(tasks), timeout=0)
        return [self._completed(task) for task in ready]

    def close(self) -> None:
        """See :meth:`Executor.close`; also shuts down a cluster that the sweep started."""
        for task in self._tasks:
            self._ray.cancel(task, force=True)
        self._tasks.clear()
        if self._owns_cluster:
            self._ray.shutdown()

    def _completed(self, task: Any) -> CompletedTask:
        cases = self._tasks.pop(task)
        try:
            return cases, self._ray.get(task)
        except self._ray.exceptions.RayTaskError as error:
            # Raised outside of the cases: the study could not be shipped to the worker.
            failure = Failure("RayTaskError", str(error.cause or error), str(error))
            return cases, [Outcome({}, 0.0, failure) for _ in cases]
        except self._ray.exceptions.RayError:
            return cases, None


def connect(ray: Any, workers: int | None, address: str | None) -> None:
    """Joins a cluster, or starts a quiet one here without a dashboard or usage statistics.

    Args:
        ray: the module.
        workers: processors of a cluster started here; all of this machine when None.
        address: address of a cluster; ``RAY_ADDRESS`` when None, and without it one is started.
    """
    options: dict[str, Any] = {"logging_level": logging.ERROR, "log_to_driver": False}
    if address is not None or os.environ.get("RAY_ADDRESS"):
        ray.init(address=address, **options)
        return
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    ray.init(
        num_cpus=workers or default_threads(),
        include_dashboard=False,
        object_store_memory=_OBJECT_STORE_BYTES,
        **options,
    )

"""Scores in live performances: their time runs, waits or goes round until GO.

t <- t + dt,   t <= t_wait,   or   t <- loop_start + (t - loop_start) mod (t_wait - loop_start)
"""

from __future__ import annotations

from fantoccini.base import UnknownNameError, check_not_negative
from fantoccini.theatre.gestures.score import Score, Wait

EARLY = 0.3
"""Time before a wait from which on GO counts [s]: a press on the beat is early or late."""


class Conductor:
    """The time of a score that is played live.

    At a :class:`Wait` the time stands still until :meth:`go`; where the wait has a loop, the time
    goes from the loop's start to the wait again and again, and after :meth:`go` it finishes the
    round and goes on. The hands at that time are ``score.offsets(conductor.t)``.

    ::

        conductor = fan.theatre.Conductor(score)
        while not conductor.done:
            offsets, rates = score.offsets(conductor.advance(dt))

    Attributes:
        score: what is played.
        t: the score's time [s].

    Args:
        score: what is played, from its start on.
    """

    def __init__(self, score: Score):
        self.score = score
        self.t, self._next, self._released = 0.0, 0, False

    def __repr__(self) -> str:
        here = "" if self.waiting is None else f", waits at {self.waiting.name}"
        of = f"{self.t:.2f} of {self.score.duration:g} s"
        return f"<Conductor of {self.score.name!r}: {of}{here}>"

    @property
    def waiting(self) -> Wait | None:
        """The wait that GO would end: it stands at it or is within its loop; otherwise None."""
        wait = self.upcoming
        if wait is None or self._released:
            return None
        begins = wait.t if wait.loop_start is None else wait.loop_start
        return wait if self.t >= begins else None

    @property
    def upcoming(self) -> Wait | None:
        """The next wait, also while it waits at it; None after the last one."""
        waits = self.score.waits
        return waits[self._next] if self._next < len(waits) else None

    @property
    def standing(self) -> bool:
        """Whether the time does not run: at a wait without a loop, or at the end."""
        wait = self.waiting
        return self.done or (wait is not None and wait.loop_start is None)

    @property
    def done(self) -> bool:
        """Whether the score is at its end, and not waiting there."""
        return self.t >= self.score.duration and self.waiting is None

    def advance(self, dt: float) -> float:
        """Lets time pass; returns the score's time [s].

        Args:
            dt: time that has passed [s]; times a factor, the tempo is another.

        Raises:
            ValueError: it is negative or not finite.
        """
        check_not_negative(dt=dt)
        t = self.t + dt
        while (wait := self.upcoming) is not None and t >= wait.t:
            if self._released:
                self._next, self._released = self._next + 1, False
            elif wait.loop_start is None:
                t = wait.t
                break
            else:
                t = wait.loop_start + (t - wait.loop_start) % (wait.t - wait.loop_start)
        self.t = min(t, self.score.duration)
        return self.t

    @property
    def released(self) -> bool:
        """Whether GO has been given for the next wait, which it has not passed yet."""
        return self._released

    def go(self, early: float = EARLY) -> bool:
        """GO: ends the wait, a loop after its round.

        Args:
            early: time before a wait from which on GO counts [s].

        Returns:
            Whether it did: earlier, after the last wait, and where GO has been given already, it
            does nothing.
        """
        wait = self.upcoming
        if wait is None or self._released:
            return False
        if self.waiting is None and self.t < wait.t - early:
            return False
        self._released = True
        self.advance(0.0)
        return True

    def seek(self, to: float | str) -> float:
        """Goes to a time [s], or to a mark or a wait by its name; returns the score's time [s].

        Waits at that time or later are waited at again.

        Raises:
            UnknownNameError: a name that the score has not.
            ValueError: a negative time.
        """
        if isinstance(to, str):
            places = {**self.score.marks, **{wait.name: wait.t for wait in self.score.waits}}
            if to not in places:
                raise UnknownNameError("mark or wait", to, places)
            to = places[to]
        check_not_negative(to=to)
        self.t = min(float(to), self.score.duration)
        self._next = sum(wait.t < self.t for wait in self.score.waits)
        self._released = False
        return self.t

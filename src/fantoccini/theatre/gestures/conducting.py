"""Time of scores in live performances: it runs, waits or loops until GO.

t <- t + dt,   t <= t_wait,   or   t <- loop_start + (t - loop_start) mod (t_wait - loop_start)

GO is the command of the conductor. t_wait is the time of the next wait, and the part of the score
from loop_start to t_wait repeats until GO.
"""

from __future__ import annotations

from fantoccini.base import UnknownNameError, check_not_negative
from fantoccini.theatre.gestures.score import Score, Wait

EARLY = 0.3
"""Time before a wait from which GO counts, so that a press on the beat may be early [s]."""


class Conductor:
    """Time of a score that is played live.

    At a :class:`Wait` the time stands still until :meth:`go`; if the wait has a loop, the time goes
    from the loop's start to the wait repeatedly, and after :meth:`go` it finishes the round and
    goes on. The hands at that time are ``score.offsets(conductor.t)``.

    ::

        conductor = fan.theatre.Conductor(score)
        while not conductor.done:
            offsets, rates = score.offsets(conductor.advance(dt))

    Attributes:
        score: score that is played.
        t: time of the score [s].

    Args:
        score: score that is played, from its start.
    """

    def __init__(self, score: Score):
        self.score = score
        self.t, self._next, self._released = 0.0, 0, False

    def __repr__(self) -> str:
        wait_text = "" if self.waiting is None else f", waits at {self.waiting.name}"
        progress = f"{self.t:.2f} of {self.score.duration:g} s"
        return f"<Conductor of {self.score.name!r}: {progress}{wait_text}>"

    @property
    def waiting(self) -> Wait | None:
        """Wait that GO would end: the time is at it or in its loop; otherwise None."""
        wait = self.upcoming
        if wait is None or self._released:
            return None
        begins = wait.t if wait.loop_start is None else wait.loop_start
        return wait if self.t >= begins else None

    @property
    def upcoming(self) -> Wait | None:
        """Next wait, even while it waits there; None after the last one."""
        waits = self.score.waits
        return waits[self._next] if self._next < len(waits) else None

    @property
    def standing(self) -> bool:
        """Whether the time stands still: at a wait without a loop, or at the end."""
        wait = self.waiting
        return self.done or (wait is not None and wait.loop_start is None)

    @property
    def done(self) -> bool:
        """Whether the score is at its end, and is not waiting there."""
        return self.t >= self.score.duration and self.waiting is None

    def advance(self, dt: float) -> float:
        """Advances the time; returns the score's time [s].

        Args:
            dt: elapsed time [s]; a factor on it changes the tempo.

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
        """Whether GO has been given for the next wait, which is still to be passed."""
        return self._released

    def go(self, early: float = EARLY) -> bool:
        """Ends the wait; a loop finishes its round.

        Args:
            early: time before a wait from which GO counts [s].

        Returns:
            Whether it had an effect. It has none earlier, after the last wait, or if GO has been
            given already.
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
        """Goes to a time [s], or to a mark or a wait by name; returns the score's time [s].

        Waits at that time or later apply again.

        Raises:
            UnknownNameError: the score has no such name.
            ValueError: the time is negative.
        """
        if isinstance(to, str):
            times_by_name = {**self.score.marks, **{wait.name: wait.t for wait in self.score.waits}}
            if to not in times_by_name:
                raise UnknownNameError("mark or wait", to, times_by_name)
            to = times_by_name[to]
        check_not_negative(to=to)
        self.t = min(float(to), self.score.duration)
        self._next = sum(wait.t < self.t for wait in self.score.waits)
        self._released = False
        return self.t

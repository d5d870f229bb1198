"""Sound of a page: clicks of a metronome, and the sounds of a score.

A script on the page hears from a websocket of the same server where the beat and the score are, and
plays by the clock of the browser's sound. Browsers stay silent until somebody clicks on the page or
presses a key.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from websockets.exceptions import ConnectionClosed

PATH = "/sound"

SOUND_SCRIPT = """
(() => {
  const AHEAD = 0.15;  // sounds are handed over so long before they are heard [s]
  const APART = 0.06;  // a sound that is off by more begins anew [s]
  let context = null, beat = null, score = null, loading = null, last = -1;
  const sounds = [], said = document.documentElement.dataset;
  said.clicks = said.sounds = "0";
  const wake = () => {
    if (context === null) context = new AudioContext();
    if (context.state === "suspended") context.resume();
  };
  for (const kind of ["pointerdown", "keydown"]) addEventListener(kind, wake, true);
  const click = (at, strong) => {
    const tone = context.createOscillator(), level = context.createGain();
    tone.frequency.value = strong ? 1760 : 1175;
    level.gain.setValueAtTime(strong ? 0.5 : 0.3, at);
    level.gain.exponentialRampToValueAtTime(0.001, at + 0.05);
    tone.connect(level).connect(context.destination);
    tone.start(at);
    tone.stop(at + 0.06);
    said.clicks = String(Number(said.clicks) + 1);
  };
  const silence = (one) => {
    if (one.source !== null) one.source.stop();
    one.source = null;
  };
  const play = (one, zero) => {
    // zero: when the score's time is 0, by the clock of the browser's sound
    const now = context.currentTime, begins = zero + one.start;
    if (begins + one.buffer.duration <= now || begins > now + 1.0) return;
    const source = context.createBufferSource(), level = context.createGain();
    level.gain.value = one.gain;
    source.buffer = one.buffer;
    source.connect(level).connect(context.destination);
    source.start(Math.max(now, begins), Math.max(0, now - begins));
    one.source = source;
    one.zero = zero;
    said.sounds = String(Number(said.sounds) + 1);
  };
  const hear = () => {
    if (context === null || context.state !== "running") return;
    const now = context.currentTime, clock = performance.now() / 1000;
    if (beat !== null) {
      const {zero, period} = beat;
      for (let k = Math.ceil((clock - zero) / period); zero + k * period < clock + AHEAD; k++) {
        const at = zero + k * period;
        if (at < last + 0.4 * period) continue;  // handed over already
        last = at;
        click(now + at - clock, k % 4 === 0);
      }
    }
    for (const one of sounds) {
      if (score === null) { silence(one); continue; }
      const zero = now + score.zero - clock;
      if (one.source !== null && Math.abs(one.zero - zero) > APART) silence(one);
      if (one.source === null && one.buffer !== null) play(one, zero);
    }
  };
  const open = () => {
    const socket = new WebSocket(location.origin.replace(/^http/, "ws") + "/sound");
    socket.binaryType = "arraybuffer";
    socket.onmessage = async (message) => {
      if (typeof message.data !== "string") {
        const one = {...loading, buffer: null, source: null, zero: 0};
        sounds.push(one);
        wake();
        one.buffer = await context.decodeAudioData(message.data).catch(() => null);
        return;
      }
      const told = JSON.parse(message.data), clock = performance.now() / 1000;
      if ("start" in told) { loading = told; return; }
      beat = told.beat === null ? null : {
        zero: clock + told.beat.next - told.beat.number * told.beat.period,
        period: told.beat.period,
      };
      score = told.score === null ? null : {zero: clock - told.score.t};
    };
    socket.onclose = () => {
      beat = score = null;
      for (const one of sounds) silence(one);
      sounds.length = 0;
      setTimeout(open, 1000);
    };
  };
  open();
  setInterval(hear, 25);
})();
"""


class _Timing(NamedTuple):
    """How often the script hears of the beat and the score [s]."""

    look: float = 0.02  # Interval at which it is looked whether something has changed
    tell: float = 0.25  # Interval at which it is told all the same: clocks drift apart


_TIMING = _Timing()


@dataclass(frozen=True)
class Clip:
    """A sound of a score.

    Attributes:
        path: of the file.
        start: when it begins [s].
        gain: factor of its loudness.
    """

    path: Path
    start: float
    gain: float


class Heard(NamedTuple):
    """What is heard now.

    Attributes:
        beat: time until the next beat [s], duration of a beat [s], and its number; or None.
        score: the score's time [s] while it runs, or None.
    """

    beat: tuple[float, float, int] | None
    score: float | None


SILENCE = Heard(None, None)


class Sounds:
    """What the scripts of all viewers are told.

    Attributes:
        version: counts what has changed: sudden changes are told at once.

    Args:
        heard: returns what is heard now; of any thread.
    """

    def __init__(self, heard: Callable[[], Heard]):
        self._heard = heard
        self._clips: tuple[tuple[Clip, bytes], ...] = ()
        self.version = 0

    def load(self, clips: Sequence[Clip]) -> None:
        """The sounds of a score, for viewers from now on.

        Raises:
            OSError: a file cannot be read.
        """
        self._clips = tuple((clip, clip.path.read_bytes()) for clip in clips)

    def changed(self) -> None:
        """What is heard has changed suddenly."""
        self.version += 1

    async def visit(self, connection: Any) -> None:
        """Serves a websocket to :data:`SOUND_SCRIPT`."""
        with contextlib.suppress(ConnectionClosed):
            await self._tell(connection)

    async def _tell(self, connection: Any) -> None:
        clips = self._clips
        for clip, content in clips:
            await connection.send(json.dumps({"start": clip.start, "gain": clip.gain}))
            await connection.send(content)
        version, before, silent = -1, 0.0, False
        while clips is self._clips:  # otherwise the script comes again, for other sounds
            now = asyncio.get_running_loop().time()
            if version != self.version or now - before > _TIMING.tell:
                version, before = self.version, now
                heard = self._heard()
                if heard != SILENCE or not silent:
                    await connection.send(_written(heard))
                silent = heard == SILENCE
            try:
                # Nothing is expected; this ends with the connection.
                await asyncio.wait_for(connection.recv(), _TIMING.look)
            except TimeoutError:
                continue


def _written(heard: Heard) -> str:
    beat = None
    if heard.beat is not None:
        until, period, number = heard.beat
        beat = {"next": until, "period": period, "number": number}
    score = None if heard.score is None else {"t": heard.score}
    return json.dumps({"beat": beat, "score": score})

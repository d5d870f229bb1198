"""Sound of a page: clicks of the metronome, and the sounds of a score.

A script on the page receives the time of the beat and the score from a websocket of the same
server, and plays by the clock of the browser's sound. Browsers stay silent until a viewer clicks
on the page or presses a key.

A beat is the unit of time of scores.
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
"""Path of the websocket."""

SOUND_SCRIPT = """
(() => {
  const AHEAD = 0.15;  // time by which sounds are scheduled in advance [s]
  const MAX_ERROR = 0.06;  // error of a sound's time above which it restarts [s]
  let context = null, beat = null, score = null, loading = null, last = -1;
  const sounds = [], counts = document.documentElement.dataset;
  counts.clicks = counts.sounds = "0";
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
    counts.clicks = String(Number(counts.clicks) + 1);
  };
  const silence = (sound) => {
    if (sound.source !== null) sound.source.stop();
    sound.source = null;
  };
  const play = (sound, zero) => {
    // zero: time on the clock of the browser's sound at which the score's time is 0
    const now = context.currentTime, begins = zero + sound.start;
    if (begins + sound.buffer.duration <= now || begins > now + 1.0) return;
    const source = context.createBufferSource(), level = context.createGain();
    level.gain.value = sound.gain;
    source.buffer = sound.buffer;
    source.connect(level).connect(context.destination);
    source.start(Math.max(now, begins), Math.max(0, now - begins));
    sound.source = source;
    sound.zero = zero;
    counts.sounds = String(Number(counts.sounds) + 1);
  };
  const schedule = () => {
    if (context === null || context.state !== "running") return;
    const now = context.currentTime, clock = performance.now() / 1000;
    if (beat !== null) {
      const {zero, period} = beat;
      for (let k = Math.ceil((clock - zero) / period); zero + k * period < clock + AHEAD; k++) {
        const at = zero + k * period;
        if (at < last + 0.4 * period) continue;  // scheduled already
        last = at;
        click(now + at - clock, k % 4 === 0);
      }
    }
    for (const sound of sounds) {
      if (score === null) { silence(sound); continue; }
      const zero = now + score.zero - clock;
      if (sound.source !== null && Math.abs(sound.zero - zero) > MAX_ERROR) silence(sound);
      if (sound.source === null && sound.buffer !== null) play(sound, zero);
    }
  };
  const open = () => {
    const socket = new WebSocket(location.origin.replace(/^http/, "ws") + "/sound");
    socket.binaryType = "arraybuffer";
    socket.onmessage = async (message) => {
      if (typeof message.data !== "string") {
        const sound = {...loading, buffer: null, source: null, zero: 0};
        sounds.push(sound);
        wake();
        sound.buffer = await context.decodeAudioData(message.data).catch(() => null);
        return;
      }
      const state = JSON.parse(message.data), clock = performance.now() / 1000;
      if ("start" in state) { loading = state; return; }
      beat = state.beat === null ? null : {
        zero: clock + state.beat.next - state.beat.number * state.beat.period,
        period: state.beat.period,
      };
      score = state.score === null ? null : {zero: clock - state.score.t};
    };
    socket.onclose = () => {
      beat = score = null;
      for (const sound of sounds) silence(sound);
      sounds.length = 0;
      setTimeout(open, 1000);
    };
  };
  open();
  setInterval(schedule, 25);
})();
"""


class _Timing(NamedTuple):
    """Intervals of messages to the script [s]."""

    check: float = 0.02  # Interval of checks for sudden changes
    repeat: float = 0.25  # Interval of messages without changes: clocks drift apart


_TIMING = _Timing()


@dataclass(frozen=True)
class SoundClip:
    """A sound of a score.

    Attributes:
        path: path of the file.
        start: time at which it begins [s].
        gain: factor on its loudness.
    """

    path: Path
    start: float
    gain: float


class SoundState(NamedTuple):
    """State of the sounds now.

    Attributes:
        beat: time until the next beat [s], duration of a beat [s], and number of the beat; or None.
        score: time of the score [s] while it runs, or None.
    """

    beat: tuple[float, float, int] | None
    score: float | None


SILENCE = SoundState(None, None)
"""State without beat and score."""


class Sounds:
    """Sender of sounds to the scripts of all viewers.

    Attributes:
        version: number of sudden changes, which are sent at once.

    Args:
        get_state: returns the current state; called from any thread.
    """

    def __init__(self, get_state: Callable[[], SoundState]):
        self._get_state = get_state
        self._clips: tuple[tuple[SoundClip, bytes], ...] = ()
        self.version = 0

    def load(self, clips: Sequence[SoundClip]) -> None:
        """Loads the sounds of a score for all viewers.

        Raises:
            OSError: a file cannot be read.
        """
        self._clips = tuple((clip, clip.path.read_bytes()) for clip in clips)

    def changed(self) -> None:
        """Reports a sudden change, which is sent at once."""
        self.version += 1

    async def serve(self, connection: Any) -> None:
        """Serves a websocket to :data:`SOUND_SCRIPT`."""
        with contextlib.suppress(ConnectionClosed):
            await self._send(connection)

    async def _send(self, connection: Any) -> None:
        clips = self._clips
        for clip, content in clips:
            await connection.send(json.dumps({"start": clip.start, "gain": clip.gain}))
            await connection.send(content)
        version, last_sent, silent = -1, 0.0, False
        while clips is self._clips:  # otherwise the script connects again, for other sounds
            now = asyncio.get_running_loop().time()
            if version != self.version or now - last_sent > _TIMING.repeat:
                version, last_sent = self.version, now
                state = self._get_state()
                if state != SILENCE or not silent:
                    await connection.send(_state_json(state))
                silent = state == SILENCE
            try:
                # No message is expected; this raises when the connection ends.
                await asyncio.wait_for(connection.recv(), _TIMING.check)
            except TimeoutError:
                continue


def _state_json(state: SoundState) -> str:
    beat = None
    if state.beat is not None:
        delay, period, number = state.beat
        beat = {"next": delay, "period": period, "number": number}
    score = None if state.score is None else {"t": state.score}
    return json.dumps({"beat": beat, "score": score})

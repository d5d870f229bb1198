"""Stream runs to motors: the three bundled stands, each on an emulated controller.

Set points of a run go to a controller that counts steps: as G-code to an emulated GRBL for the six
winches and the desk-top stand, as OSC packets in real time to emulated motors for the 21 steppers
(ten seconds). Then the puppet is simulated again, hung from the motors' actual positions. Writes
out/six_winches.gcode, out/desktop6.gcode and out/gantry21.cfg, a macro for Klipper.
"""

import time
from pathlib import Path

import numpy as np

import fantoccini as fan
from fantoccini.stand import (
    GrblMachine,
    Receiver,
    gcode,
    grbl_settings,
    save_points,
    send_points,
    udp_sender,
)

RATE = 25.0  # Hz, readings of the motors for the new run; slow enough to smooth their steps

out = Path("out")
out.mkdir(exist_ok=True)


def performance(puppet, name):
    path = fan.puppets.path(puppet.puppet.name).parent / "performances" / f"{name}.yaml"
    return fan.Input.load(puppet, path)


def on_grbl(points):
    """Times [s] and positions [m] of the motors of an emulated GRBL."""
    machine = GrblMachine(grbl_settings(points.map.stand, points.controller, points.rate))
    for line in gcode(points).splitlines():
        assert machine.answer(line) == "ok"
    t = np.append(np.arange(0.0, points.motion.t[-1], 1.0 / RATE), points.motion.t[-1])
    return t, 1e-3 * machine.positions(machine.dwell_ends[0] + t)


def over_a_network(points):
    """Likewise for motors driven by packets, at the times of the set points."""
    with Receiver(points.map.stand, points.controller, "127.0.0.1", 0) as motors:
        with udp_sender(*motors.address) as send:
            done = send_points(points, send, max_delay=1.0)  # these motors carry no load
        time.sleep(0.1)
    print(f"  {done.sent} packets, the latest {1e3 * done.max_delay:.1f} ms late")
    t, k = np.unique(np.round(done.times, 9), return_index=True)
    return t, motors.steps[k] / [axis.counts_per_unit for axis in points.axes]


def again(puppet, run, points, t, p):
    """Largest distance of the puppet's links from the run, on motor positions (T, n) [mm]."""
    columns = dict(zip(points.map.names, points.map.coordinates_of(p).T, strict=True))
    names = run.coordinates.q_K
    columns |= {n: np.full(len(t), run.q_K[0, names.index(n)]) for n in points.map.held}
    start = puppet.rest({name: float(x[0]) for name, x in columns.items()})
    moved = fan.simulate(puppet, start, fan.Input.samples(puppet, t, columns), float(t[-1]))
    at = np.linspace(0.0, float(t[-1]), 1001)
    first, second = (
        puppet.poses(r.resample(at).q_D, r.resample(at).q_K)[..., 3] for r in (run, moved)
    )
    return 1e3 * np.linalg.norm(first - second, axis=-1).max(axis=1)


marionette, stand6 = fan.puppets.marionette(), fan.puppets.stand6()
up, wave = (0.9154, 0.68), (0.18, 0.23, 0.15, 0.23, 0.15, 0.18)
times = (1.5, 1.9, 2.3, 2.7, 3.1, 3.4)
waves = {}
for side, sign in (("left", 1.0), ("right", -1.0)):
    waves[f"hand_{side}.length"] = [(0.3, up[0]), (1.5, up[1]), (3.4, up[1]), (4.6, up[0])]
    waves[f"hand_{side}.x"] = [(0.3, 0.14), (1.5, 0.18), (3.4, 0.18), (4.6, 0.14)]
    sideways = [(t, sign * y) for t, y in zip(times, wave, strict=True)]
    waves[f"hand_{side}.y"] = [(0.3, sign * 0.14), *sideways, (4.6, sign * 0.14)]

for stand, puppet, inputs, duration, kind, ending in (
    ("six_winches", stand6, performance(stand6, "conduct"), 5.0, "fluidnc", "gcode"),
    ("desktop6", marionette, fan.Input.waypoints(marionette, waves), 5.0, None, "gcode"),
    ("gantry21", marionette, performance(marionette, "greeting"), 10.0, "osc", "cfg"),
):
    run = fan.simulate(puppet, puppet.rest(), inputs, duration)
    print(fan.stand.check_stand(stand, run, puppet).summary())
    points = fan.stand.set_points(stand, run, puppet, controller=kind)
    t, p = over_a_network(points) if kind == "osc" else on_grbl(points)
    planned = points.map.motion_of(run, t)
    counts = np.array([axis.counts_per_unit for axis in points.axes])
    steps = np.abs(np.rint(p * counts) - np.rint(planned.position * counts)).max()
    away = again(puppet, run, points, t, p)
    print(
        f"  motors within {steps:.0f} steps; puppet {np.median(away):.2f} mm from its run, at "
        f"most {away.max():.2f} mm"
    )
    stored = fan.stand.set_points(stand, run, puppet) if kind == "osc" else points
    save_points(stored, out / f"{stand}.{ending}")

"""Feedback: a hand is held at a height while the string's end wanders sideways.

The winch is told its acceleration 100 times a second by a law that sees the state. Without the
law the hand would rise and fall with the string's end. Writes out/feedback.csv.
"""

from pathlib import Path

import numpy as np

import fantoccini as fan

out = Path("out")
out.mkdir(exist_ok=True)

arm = fan.puppets.arm2d()
x0 = arm.rest({"hand.length": 0.8})
HAND = np.array([0.3, 0.0, 0.0])  # in the frame of the lower arm
TARGET = -0.0


def hand(x: fan.State) -> tuple[float, float]:
    """Height [m] and its rate [m/s] of the hand."""
    pose = arm.pose(x, "lower")
    v, w = np.split(arm.body_velocity(x, "lower"), 2)
    return pose[2, 3] + pose[2, :3] @ HAND, pose[2, :3] @ (v + np.cross(w, HAND))


def wander(x: fan.State) -> float:
    """Acceleration of the string's end: to and fro once in 2 s [m/s^2]."""
    return 0.8 * np.cos(np.pi * x.t)


def law(x: fan.State) -> dict[str, float]:
    """A longer string lowers the hand: accelerate the length along error and rate."""
    z, rate = hand(x)
    return {"hand.x": wander(x), "hand.length": 400.0 * (z - target) + 40.0 * rate}


target = hand(x0)[0]
for name, chosen in (("winch still", lambda x: {"hand.x": wander(x)}), ("feedback", law)):
    stepper = arm.stepper(x0, dt=0.001)
    states = stepper.run(t_end=4.0, law=chosen, rate=100)
    heights = np.array([hand(x)[0] for x in states])
    print(f"{name:<12} hand within {1000 * np.abs(heights - target).max():6.2f} mm of its height")

rows = np.array([(x.t, *x.q_K, *hand(x)) for x in states])
np.savetxt(out / "feedback.csv", rows, delimiter=",", comments="",
           header="t,hand.x,hand.length,z,zdot")  # fmt: skip
print("wrote", out / "feedback.csv")

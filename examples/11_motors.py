"""Drive a winch with two stepper motors: one strong enough, and one that loses steps.

The kinematic model moves the string exactly. Here a rotor with a gear and a drum winds it, and the
holding torque decides whether the arm follows. A weak motor lifts the arm, then slips and lets it
fall step by step. The example writes out/motors.png.
"""

from pathlib import Path

import fantoccini as fan

out = Path("out")
out.mkdir(exist_ok=True)

WINCH = """
drives:
  - on: hand.length
    inertia: 5.0e-6
    gear: 2
    drum: 0.015
    friction: {viscous: 2.0e-5}
    motor: {type: stepper, torque: {parameter: torque, value: 0.05}, microsteps: 8}
"""
mixed = fan.puppets.arm2d()
stand = fan.loads(mixed.puppet.to_yaml() + WINCH)

LIFT = {"hand.length": [(0, 0.8), (0.6, 0.55), (1.0, 0.55), (1.6, 0.8)]}
ideal = fan.simulate(mixed, mixed.rest({"hand.length": 0.8}), fan.Input.waypoints(mixed, LIFT))
command = ideal.q_K[:, ideal.coordinates.q_K.index("hand.length")]
print(f"command: the string from {command[0]:.2f} m to {command.min():.2f} m and back")
for torque in (0.05, 0.018):
    arm = stand.with_parameters({"torque": torque})
    x0 = arm.rest({"hand.length": 0.8})
    lift = fan.Input.waypoints(arm, LIFT)
    run = fan.simulate(arm, x0, lift, t_end=2.5, method=fan.TimeStepping(dt=1e-4), throw=False)
    length = run.q_D[:, run.coordinates.q_D.index("hand.length")]
    force = max(abs(run.effort["hand.command.length"]))
    print(
        f"{1e3 * torque:4.0f} mN m: pulls up to {force:.2f} N, reaches {length.min():.3f} m, "
        f"{length[-1] - 0.8:+.3f} m off at the end: {run.status.message}"
    )
run.plot(out / "motors.png")
print("wrote", out / "motors.png")

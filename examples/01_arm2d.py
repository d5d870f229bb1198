"""Evaluate the equations of the paper's arm (Fig. 2), lift it, and plot the lift.

Writes out/arm2d.png and out/arm2d.npz.
"""

from pathlib import Path

import numpy as np

import fantoccini as fan

out = Path("out")
out.mkdir(exist_ok=True)

arm = fan.puppets.arm2d()
x0 = arm.rest({"hand.length": 0.8})
print(arm)

# Eqs. 8 and 9 at rest: M acc_D + c = A_D^T lambda, and A_D v_D + A_K v_K = 0.
M, c = arm.mass_matrix(x0), arm.bias(x0)
A_D, A_K = arm.A_D(x0), arm.A_K(x0)
print("M =", np.array2string(M, precision=5, prefix="M = "))
print("c =", c.round(5), " A_D =", A_D.round(5), " A_K =", A_K.round(5))

# Eqs. 10 and 11 are one linear system for acc_D and lambda; the tension is minus lambda.
system = np.block([[M, -A_D.T], [A_D, np.zeros((1, 1))]])
solution = np.linalg.solve(system, np.concatenate([-c, -arm.Adot_v(x0)]))
acc_D, tension = arm.forward_dynamics(x0)
print(f"tension at rest: {-solution[2]:.6f} N by hand, {tension[0]:.6f} N by fantoccini")

# The lift: the string is shortened by 30 cm in 1.5 s.
lift = fan.Input.waypoints(arm, {"hand.length": [(0, 0.8), (1.5, 0.5)]})
run = fan.simulate(arm, x0, lift, t_end=3.0)
print(f"lift: {run.status.message}; tension up to {run.tension['hand'].max():.3f} N")
work, residual = run.ledger["work"][-1], np.abs(run.ledger["residual"]).max()
print(f"work of the winch: {work:.4f} J; the energy ledger closes to {residual:.0e} J")

# Pushed upwards, the arm flies free of its string, which then snaps taut (Eqs. 13-15).
thrown = fan.simulate(arm, x0.replace(v_D=[2.0, 0.5]), t_end=2.0)
for event in thrown.events:
    print(f"{event.t:.4f} s: {event.name} {event.kind}, impulse {event.impulse:.4f} N s")

run.save(out / "arm2d.npz")
run.plot(out / "arm2d.png", scale=1.0)
print("wrote", out / "arm2d.png", "and", out / "arm2d.npz")

"""Sweep a grid: a winch lifts the arm at several speeds, masses and noisy starts.

A sweep runs a study for every case on all cores, or with on="ray" on a cluster. It
stores its cases in a folder and resumes after an interruption. Writes out/sweep.csv and
out/sweep.png.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import fantoccini as fan

out = Path("out")
out.mkdir(exist_ok=True)


def lifted(case: fan.lab.Case) -> dict:
    """Lifts the arm by 0.2 m while it swings a little."""
    arm = case.marionette
    swing = 0.3 * case.rng.standard_normal()
    x0 = arm.project(arm.state({"hand.length": 0.8, "v:elbow": swing}))
    lift = fan.Input.waypoints(arm, {"hand.length": [(0, 0.8), (case["seconds"], 0.6)]})
    run = fan.simulate(arm, x0, lift, t_end=1.0, method="timestepping")
    return {
        "peak": run.tension["hand"].max(),
        "catches": run.summary()["tension"]["hand"]["catches"],
        "end": run.q_D[-1],
    }


grid = {"p:m2": [0.05, 0.08, 0.12], "seconds": [0.1, 0.2, 0.3, 0.5, 0.8]}
settings = {"puppet": fan.puppets.arm2d(), "seeds": 6, "store": out / "sweep"}
result = fan.sweep(lifted, grid, **settings)
print(result)

again = fan.sweep(lifted, grid, **settings)
print("same results from the store, without a run:", np.array_equal(result["end"], again["end"]))

peak = result["peak"]  # (masses, seconds, repetitions)
for mass, row in zip(result.axes["p:m2"], peak.mean(axis=2), strict=True):
    print(f"m2 = {mass:.2f} kg: mean peak tension " + ", ".join(f"{x:.2f}" for x in row) + " N")

slow = fan.lab.Trial(
    t_end=1.0, inputs={"hand.length": [(0, 0.8), (0.8, 0.6)]}, keep=["max energy:work"]
)
drawn = fan.sweep(slow, puppet=settings["puppet"], draw={"p:m2": (0.05, 0.12)}, seeds=20)
work = drawn["max energy:work"]
print(f"slowly, with a mass drawn 20 times: {work.min():.3f} to {work.max():.3f} J of work")

result.to_csv(out / "sweep.csv")
for mass, row in zip(result.axes["p:m2"], peak, strict=True):
    plt.errorbar(result.axes["seconds"], row.mean(1), row.std(1), label=f"{mass:.2f} kg", capsize=3)
plt.xlabel("duration of the lift [s]")
plt.ylabel("peak tension [N]")
plt.legend(title="lower arm")
plt.savefig(out / "sweep.png")
print("wrote", out / "sweep.csv", "and", out / "sweep.png")

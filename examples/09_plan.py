"""Plan a motion past obstacles: the paper's Section VII, an arm on one string and two boxes.

The dots are the hand at every state of the search tree, as in the paper's Fig. 4; the line is the
path found. Then a marionette's hand moves past a lamp to a bell. Writes out/plan_arm.png,
out/plan_bell.png and out/plan_bell.npz.
"""

from pathlib import Path

import fantoccini as fan

out = Path("out")
out.mkdir(exist_ok=True)

problem = fan.control.load_problem("arm3d_boxes")
plan = fan.control.solve(problem, seed=3)
print(plan)
polished = plan.grow(0.4).polish(1e-3)
verified = polished.verify(method="event")
print(
    f"polished: {polished.duration:.2f} s, {polished.distance:.1e} from the goal; with located "
    f"events {verified.distance:.1e}, {1e3 * verified.clearance:.1f} mm from the boxes"
)
polished.plot(out / "plan_arm.png")

bell = fan.control.solve(fan.control.load_problem("marionette_bell"), seed=4)
print(bell)
bell.plot(out / "plan_bell.png")
bell.trajectory.save(out / "plan_bell.npz")

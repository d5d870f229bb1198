"""Check a stand: the paper's six winches, with motors that are strong enough and too weak.

The puppet conducts. A check gives every motor's margin and the one that loses steps first;
for the weak ones it computes remedies and simulates a slower tempo, at which the puppet
moves differently. Writes out/strong.html and out/weak.html.
"""

from pathlib import Path

import fantoccini as fan
from fantoccini.output import reports
from fantoccini.stand import find_slower_tempo, loads_stand, lost_step_lines, remedies
from fantoccini.stand.stand_file import BUNDLED_STANDS_FOLDER

out = Path("out")
out.mkdir(exist_ok=True)

puppet = fan.puppets.stand6()
moves = fan.puppets.path("stand6").parent / "performances" / "conduct.yaml"
run = fan.simulate(puppet, puppet.rest(), fan.Input.load(puppet, moves), 5.0)

strong = fan.stand.check_stand("six_winches", run, puppet)
print(strong.summary())
reports.stand_report(strong, out / "strong.html")

# The same stand with motors that are strong and slow, as on a supply of 12 V.
text = (BUNDLED_STANDS_FOLDER / "six_winches.yaml").read_text(encoding="utf-8")
text = text.replace(
    "[[0, 0.88], [11, 0.88], [16, 0.60], [22, 0.44], [33, 0.29]]",
    "[[0, 0.50], [1, 0.42], [3, 0.10], [4, 0.015]]",
)
weak = fan.stand.check_stand(loads_stand(text), run, puppet)
print(weak.summary())
for line in (*lost_step_lines(weak), *remedies(weak)):
    print(line)
slower_run = find_slower_tempo(weak)
print("slower:", slower_run[1])
reports.stand_report(weak, out / "weak.html", slower_run)

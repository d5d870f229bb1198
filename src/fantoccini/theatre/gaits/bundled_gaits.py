"""Gaits of bundled puppets on a floor, each the result of a search."""

from __future__ import annotations

from collections.abc import Mapping

from fantoccini.theatre.gaits.gait import Gait

BUNDLED_GAITS: Mapping[str, Gait] = {
    "dachshund": Gait(
        pattern="trot",
        duty=0.2630960438428066,
        lower=0.029158874567706876,
        nod=0.0006371806813845037,
        slack=0.022241904746053788,
        lift=0.19219018603682686,
        leg_lead=0.20365397491567402,
        body_lead=-0.04212908956896589,
        overshoot=0.008941754182766262,
        sway=-0.01544227659903244,
        vertical_share=0.1282499930081487,
        peak_share=0.3518971634136726,
    ),
    "hans": Gait(
        stride=0.08,
        duty=0.7101534681971471,
        lower=0.04463510899480003,
        nod=-0.0026636438514072262,
        slack=0.0,
        lift=0.14418626509279514,
        leg_lead=-0.050706536394925616,
        body_lead=-0.12845079860160372,
        overshoot=0.12157140954049825,
        sway=-0.010005062193768993,
        vertical_share=0.09968153906274888,
        peak_share=0.4,
    ),
    "marionette": Gait(
        duty=0.557084265185432,
        lower=0.030135264990831884,
        nod=-0.02151030600702335,
        slack=0.003352562149473888,
        lift=0.19460629000171153,
        leg_lead=-0.05589494825359404,
        body_lead=-0.2000313746082361,
        overshoot=0.1775447391377389,
        sway=-0.006663049281129267,
        vertical_share=0.12282758870822792,
        peak_share=0.31489467544172334,
    ),
}
"""Name of a bundled puppet -> gait with which it walks on a floor."""

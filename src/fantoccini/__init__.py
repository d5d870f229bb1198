"""Dynamics of marionettes: articulated rigid bodies hung from massless strings.

import fantoccini as fan

arm = fan.puppets.arm2d()
x0 = arm.rest({"hand.length": 0.8})
lift = fan.Input.waypoints(arm, {"hand.length": [(0, 0.8), (1.5, 0.5)]})
run = fan.simulate(arm, x0, lift, t_end=3.0)
"""

import lazy_loader

__version__ = "0.1.0"

# The public names stand in __init__.pyi; each is imported when it is first asked for.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
__all__ += ["__version__"]

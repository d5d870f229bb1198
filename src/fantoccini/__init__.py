"""Dynamics of marionettes: articulated rigid bodies hung from massless strings.

import fantoccini as fan

arm = fan.puppets.arm2d()
x0 = arm.rest({"hand.length": 0.8})
lift = fan.Input.waypoints(arm, {"hand.length": [(0, 0.8), (1.5, 0.5)]})
run = fan.simulate(arm, x0, lift, t_end=3.0)
"""

from typing import Any

import lazy_loader

__version__ = "0.1.0"

# The public names stand in __init__.pyi; each is imported when it is first asked for.
_getattr, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
_RENAMED = {
    "Puppet": "model.Puppet, the contents of a file; fan.load returns a marionette",
    "Reach": "control.ReachedPoses",
    "Sensitivity": "dynamics.RunSensitivity",
    "Show": "theatre.LivePlay",
}
_PACKAGES = (
    "errors",
    "control",
    "dynamics",
    "lab",
    "model",
    "motion",
    "output",
    "stand",
    "theatre",
)


def __getattr__(name: str) -> Any:
    try:
        return _getattr(name)
    except AttributeError:
        if name.startswith("_"):
            raise
        owners = [package for package in _PACKAGES if name in dir(_getattr(package))]
        path = _RENAMED.get(name) or (f"{owners[0]}.{name}" if owners else "")
        hint = f"; it is fantoccini.{path}" if path else ""
        raise AttributeError(f"module 'fantoccini' has no attribute {name!r}{hint}") from None


__all__ += ["__version__"]

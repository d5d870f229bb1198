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
    "Reach": "control.ReachedPoses",
    "Sensitivity": "dynamics.RunSensitivity",
    "Show": "theatre.LivePlay",
}
_NOTES = {"Puppet": "the contents of a file; fan.load returns a marionette"}
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
        message = f"module 'fantoccini' has no attribute {name!r}{_location_hint(name)}"
        raise AttributeError(message) from None


def _location_hint(name: str) -> str:
    """Clause of an error message that says where a name is now; empty for unknown names."""
    owners = [package for package in _PACKAGES if name in dir(_getattr(package))]
    path = _RENAMED.get(name) or (f"{owners[0]}.{name}" if owners else "")
    note = f", {_NOTES[name]}" if name in _NOTES else ""
    return f"; it is fantoccini.{path}{note}" if path else ""


__all__ += ["__version__"]

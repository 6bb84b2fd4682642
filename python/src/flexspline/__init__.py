"""Where simulation and robot part, which physical effect causes it, and how far the gap shrinks once it is added.

    import flexspline as fx
    robot = fx.Robot("arm.urdf")
    report = fx.diagnose(robot, "run.mcap")
    report.apply().to_mjcf("mended.xml")
"""

from ._diagnose import diagnose
from ._errors import FlexsplineError, FormatWarning, InputError, NegativeError
from ._experiments import Suggestion, identify, simulate, suggest
from ._live import Attachment, attach, watch
from ._native import __version__
from ._recording import Recording
from ._report import Effect, JointReport, Parameter, Remains, Report
from ._robot import Robot

__all__ = [
    "Attachment",
    "Effect",
    "FlexsplineError",
    "FormatWarning",
    "InputError",
    "JointReport",
    "NegativeError",
    "Parameter",
    "Recording",
    "Remains",
    "Report",
    "Robot",
    "Suggestion",
    "__version__",
    "attach",
    "diagnose",
    "identify",
    "simulate",
    "suggest",
    "watch",
]


def __getattr__(name: str) -> object:
    # What a fleet needs, Arrow first of all, is imported by who has one.
    if name == "fleet":
        from importlib import import_module

        return import_module(".fleet", __name__)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

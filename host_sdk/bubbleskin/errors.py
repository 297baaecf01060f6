"""The one family of errors. A message says what was asked, what is allowed and what to do next."""


class BubbleskinError(Exception):
    """Something went wrong that its message explains. The command line ends with status 1."""


class InvalidInput(BubbleskinError, ValueError):  # noqa: N818 - a user reads it, and it is not the program's error
    """What the user gave cannot be meant: refused before anything else happens. Exit status 2."""


class LinkError(BubbleskinError):
    """No device can be reached, or the one that was reached has gone.

    `outcome_unknown`: whether what was asked may have been applied. It is never applied later, nor twice.
    """

    outcome_unknown = False


class DeviceSilent(LinkError, TimeoutError):  # noqa: N818
    """The device has not answered in time."""


class DeviceRestarted(LinkError):  # noqa: N818
    """The device has restarted: it vents and has forgotten everything. Nothing was sent again."""


class WrongDevice(LinkError):  # noqa: N818
    """Whatever is at the other end is no wristband, or speaks another version of the protocol."""


class DeviceRefused(BubbleskinError):  # noqa: N818
    """The device understood a request and refused it; nothing was changed there."""


class Overtaken(DeviceRefused):
    """A later STOP or VENT came first; what was asked was not applied, and never will be."""


class DeviceFault(BubbleskinError):  # noqa: N818
    """The device reports faults, or did not do what it was asked in time."""


class NoEquilibrium(BubbleskinError):  # noqa: N818
    """Pressed like this, the bubbles of the model come to no rest."""

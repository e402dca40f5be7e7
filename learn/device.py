"""Where a network computes: on the processor, whose results are the same bytes each time, or on a GPU."""

from typing import Literal

from groundwork.errors import InputError

Device = Literal["cpu", "gpu", "auto"]
"""`auto` is a GPU if torch finds one."""


def check_device(device: Device, field: str = "device") -> None:
    """Refuse a GPU where torch finds none.

    Args:
        device: What the user requests.
        field: Name of the setting, for the error message.

    Raises:
        InputError: No GPU although one is requested.
    """
    from torch.cuda import device_count

    if device == "gpu" and not device_count():
        raise InputError(
            "torch can use no GPU",
            field=field,
            value="gpu",
            allowed="auto, cpu",
            hint="Install a torch that fits the driver, or choose cpu",
        )


def torch_device(device: Device) -> str:
    """Return torch's name of a device.

    Args:
        device: What the user requests.
    """
    from torch.cuda import device_count

    # counted, because `is_available` would initialize CUDA and prevent its use in forked processes
    return "cuda" if device == "gpu" or (device == "auto" and device_count() > 0) else "cpu"

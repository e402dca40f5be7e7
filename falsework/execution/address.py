"""The address of a cluster's scheduler, as a user names it."""

import re

from groundwork.errors import InputError

_ADDRESS = re.compile(r"(tcp|tls)://[^\s/:]+:[0-9]{1,5}|(tcp|tls)://\[[0-9a-fA-F:.]+\]:[0-9]{1,5}")
_LAST_PORT = 65535


def check_address(address: str) -> None:
    """Refuse what cannot be the address of a scheduler, before anything is made.

    Args:
        address: What the user named.

    Raises:
        InputError: Not of the form that Dask's schedulers have.
    """
    if not _ADDRESS.fullmatch(address) or int(address.rpartition(":")[2]) > _LAST_PORT:
        raise InputError(
            "not an address of a scheduler",
            field="--cluster",
            value=address,
            allowed="tcp://HOST:PORT or tls://HOST:PORT",
        )

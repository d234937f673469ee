"""The address of a Dask scheduler, as every command that takes one checks it; nothing heavy is imported."""

import re

from closedrooms.core.errors import InvalidInputError


def check_scheduler(address: str | None) -> None:
    """Refuse what is no address.

    Args:
        address: ``tcp://host:port`` or another protocol of Dask's, ``None`` for local processes.

    Raises:
        InvalidInputError: Something else.
    """
    if address is not None and not re.fullmatch(r"(tcp|tls|ws|ucx)://\S+:\d+", address):
        raise InvalidInputError(f"--scheduler {address}", expected="tcp://host:port")

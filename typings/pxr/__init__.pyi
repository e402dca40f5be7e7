# usd-core ships compiled modules without types, and no stub package covers this release: every name in pxr is Any.
from typing import Any

def __getattr__(name: str) -> Any: ...

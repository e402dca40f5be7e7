# Triton comes with torch where there are GPUs; every other name in it is Any.
from typing import Any, TypeAlias

class constexpr: ...

tensor: TypeAlias = Any

def __getattr__(name: str) -> Any: ...

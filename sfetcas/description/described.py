"""What ``help`` and completion show of records: their keys with defaults, and their own methods."""

from __future__ import annotations

from inspect import Parameter, Signature
from typing import TYPE_CHECKING, Any

from pydantic import BaseModel

__all__ = ["Described"]

if TYPE_CHECKING:
    Described = BaseModel
else:

    class _DescribedType(type(BaseModel)):
        """The type of records, which lists of their attributes those that are meant for users."""

        def __dir__(cls) -> list[str]:
            return [name for name in super().__dir__() if not name.startswith("_") and not hasattr(BaseModel, name)]

    class Described(BaseModel, metaclass=_DescribedType):
        """A pydantic model that shows its keys and its own methods only."""

        @classmethod
        def __pydantic_init_subclass__(cls, **_: Any) -> None:
            # That of pydantic spells out validators, with the addresses of their functions.
            keys = {name: _default(field) for name, field in cls.model_fields.items()}
            cls.__signature__ = Signature(
                [Parameter(name, Parameter.KEYWORD_ONLY, default=default) for name, default in keys.items()]
            )

        def __dir__(self) -> list[str]:
            return [*type(self).model_fields, *dir(type(self))]

    def _default(field: Any) -> Any:
        return Parameter.empty if field.is_required() else field.get_default(call_default_factory=True)

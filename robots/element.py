"""Common base of all parts of a robot's description: they are immutable, refuse unknown keys, and keep their content
when they do not use what came later.
"""

from functools import cached_property
from typing import Annotated, Any, ClassVar

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    SerializationInfo,
    SerializerFunctionWrapHandler,
    model_serializer,
)

Vector3 = tuple[float, float, float]
Color = Annotated[str, Field(pattern="^#[0-9a-fA-F]{6}$")]
Length = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
Radius = Annotated[float, Field(ge=0.0, allow_inf_nan=False)]


class Element(BaseModel):
    """Immutable data that refuses unknown keys."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, ignored_types=(cached_property,), defer_build=True
    )

    later: ClassVar[tuple[str, ...]] = ()
    """Fields that came after version 0.1. They are left out where they have their default, so that
    a description that does not use them keeps its content, and plans made for it their keys."""
    seen_only: ClassVar[tuple[str, ...]] = ()
    """Fields that say what the part looks like, on which nothing that is computed depends. They are
    in a dump only with ``context={"looks": True}``: a robot keeps its content without its meshes."""
    simulated_only: ClassVar[tuple[str, ...]] = ()
    """Fields that only effects of a simulated robot need, and no plan and no controller. They are in a dump with
    ``context={"simulated": True}`` and in one with looks."""

    @model_serializer(mode="wrap")
    def _without_unused(
        self, serialize: SerializerFunctionWrapHandler, info: SerializationInfo
    ) -> dict[str, Any]:
        data: dict[str, Any] = serialize(self)
        fields = type(self).model_fields
        context = info.context or {}
        looks = bool(context.get("looks"))
        simulated = looks or bool(context.get("simulated"))
        for name in self.later:
            if getattr(self, name) == fields[name].default:
                data.pop(name, None)
        for name in self.seen_only:
            if not looks or getattr(self, name) == fields[name].default:
                data.pop(name, None)
        for name in self.simulated_only:
            if not simulated or getattr(self, name) == fields[name].default:
                data.pop(name, None)
        return data

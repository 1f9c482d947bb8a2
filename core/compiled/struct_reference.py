# SPDX-License-Identifier: GPL-3.0-or-later
"""``@by_reference``: a NamedTuple of arrays that kernels take as one pointer.

Numba takes a tuple apart wherever it is handed on: seven words for every array, so a kernel that is given the solver's hundred
arrays has seven hundred arguments. Compiling those takes minutes, and calling takes longer than all the arithmetic of a small
step. Here each tuple has written down once where its arrays are, and kernels hand on the address of that. For Python code and
plain Python mode nothing changes.

Loads are marked as invariant: kernels write into the arrays, never over what says where those are, so the compiler may keep
that in registers whatever is written.
"""

from __future__ import annotations

import hashlib
import operator
from functools import cached_property
from typing import Any, TypeVar, cast

import numpy as np

from .kernels import COMPILED

Class = TypeVar("Class", bound=type)

if not COMPILED:

    def by_reference(cls: Class) -> Class:
        """Leave the class as it is: only compiled code would take its instances apart."""
        return cls

else:
    from llvmlite import ir
    from numba import typeof
    from numba.core import cgutils, types
    from numba.core.datamodel import models
    from numba.core.imputils import impl_ret_borrowed, lower_getattr_generic
    from numba.core.typing.templates import AttributeTemplate, infer_getattr
    from numba.extending import NativeValue, register_model, typeof_impl, unbox

    _BYTES = cgutils.voidptr_t
    _OWNERS = 2
    """How many words of a compiled array say who owns it; they come first."""

    class Reference(types.Type):
        """Numba's type of such a tuple: its class, and the types of its fields."""

        def __init__(self, cls: Any, fields: tuple[Any, ...]) -> None:
            self.cls, self.fields = cls, fields
            which = hashlib.sha256(repr(fields).encode()).hexdigest()[:12]
            super().__init__(f"{cls.__name__}_{which}")  # short: it is part of the name of every function that takes one

        @property
        def key(self) -> Any:
            """What tells one type from another."""
            return self.cls, self.fields

    @register_model(Reference)
    class _Model(models.PrimitiveModel):
        """A pointer to the fields, word by word."""

        def __init__(self, manager: Any, kind: Reference) -> None:
            super().__init__(manager, kind, _BYTES)

    @infer_getattr
    class _Fields(AttributeTemplate):
        key = Reference

        def generic_resolve(self, kind: Reference, name: str) -> Any:
            """Type of a field; None says that there is none of that name."""
            names = kind.cls._fields
            return kind.fields[names.index(name)] if name in names else None

    def _size(field: Any) -> int:
        """How many words a field takes."""
        return 5 + 2 * field.ndim if isinstance(field, types.Array) else 1

    def _field(context: Any, builder: Any, kind: Reference, pointer: Any, at: int) -> Any:
        """Pointer to a field."""
        place = cgutils.gep_inbounds(builder, pointer, 8 * sum(map(_size, kind.fields[:at])))
        return builder.bitcast(place, context.get_value_type(kind.fields[at]).as_pointer())

    @lower_getattr_generic(Reference)
    def _get(context: Any, builder: Any, kind: Reference, pointer: Any, name: str) -> Any:
        at = kind.cls._fields.index(name)
        field, place = kind.fields[at], _field(context, builder, kind, pointer, at)
        owned = isinstance(field, types.Array) and not context.enable_nrt  # nobody asks for the owner where none is counted
        return impl_ret_borrowed(context, builder, field, _load(builder, place, _OWNERS if owned else 0))

    def _load(builder: Any, place: Any, skip: int = 0) -> Any:
        """Load a value number by number: the mark of a load of many would be lost when the compiler takes it apart."""
        kind = place.type.pointee
        if isinstance(kind, (ir.LiteralStructType, ir.ArrayType)):
            value = ir.Constant(kind, ir.Undefined)
            for i in range(skip, len(kind)):
                value = builder.insert_value(value, _load(builder, cgutils.gep_inbounds(builder, place, 0, i)), i)
            return value
        value = builder.load(place)
        value.set_metadata("invariant.load", builder.module.add_metadata([]))
        return value

    @unbox(Reference)
    def _unbox(kind: Reference, instance: Any, c: Any) -> Any:
        """Ask the instance where its fields are written down."""
        builder = c.builder
        answer = c.pyapi.object_getattr_string(instance, "address")
        failed = cgutils.is_null(builder, answer)
        pointer = cgutils.alloca_once_value(builder, ir.Constant(_BYTES, None))
        with builder.if_then(builder.not_(failed), likely=True):
            builder.store(builder.inttoptr(c.pyapi.long_as_longlong(answer), _BYTES), pointer)
            c.pyapi.decref(answer)
        return NativeValue(builder.load(pointer), is_error=failed)

    def _written(value: Any) -> list[Any]:
        """Return the words that a field takes in compiled code."""
        if isinstance(value, np.ndarray):  # no reference is counted: the instance keeps its arrays
            return [0, id(value), value.size, value.itemsize, value.ctypes.data, *value.shape, *value.strides]
        if isinstance(value, tuple):
            return [cast(Any, value).address]
        return [operator.index(value)]

    def by_reference(cls: Class) -> Class:
        """Have kernels take instances of a NamedTuple as one pointer; fields are arrays, integers, or such tuples again."""

        class Referred(cls):  # type: ignore[misc, valid-type]
            """With room to keep what compiled code asks for."""

            @cached_property
            def numba_type(self) -> Reference:
                """Numba's type of this instance."""
                return Reference(Referred, tuple(typeof(field) for field in self))

            @cached_property
            def _words(self) -> np.ndarray:
                return np.array([word for field in self for word in _written(field)], np.int64)

            @cached_property
            def address(self) -> int:
                """Where the fields are written down, for as long as this instance lives."""
                return int(self._words.ctypes.data)

        hidden = [name for name in Referred._fields if getattr(Referred, name) is not getattr(cls, name)]
        if hidden:
            raise TypeError(f"{cls.__name__}: a field may not be called {hidden[0]}")
        for name in ("__name__", "__qualname__", "__module__", "__doc__"):
            setattr(Referred, name, getattr(cls, name))

        @typeof_impl.register(Referred)
        def _typeof(value: Any, context: Any) -> Reference:
            return cast(Reference, value.numba_type)

        return cast(Class, Referred)

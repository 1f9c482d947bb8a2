# SPDX-License-Identifier: GPL-3.0-or-later
"""``@by_reference``: a NamedTuple of arrays that kernels take as one pointer.

Numba unpacks a tuple wherever it is passed on, into seven words for every array, so a kernel that takes the solver's hundred
arrays would have seven hundred arguments. Compiling those takes minutes, and calling takes longer than all the arithmetic of a
small step. Here each tuple writes down once where its arrays are, and kernels pass on the address of that. A field may be such
a tuple again, which costs one more load. For Python code and plain Python mode nothing changes.

Loads are marked as invariant: kernels write into the arrays, never over their addresses, so the compiler may keep those in
registers.
"""

from __future__ import annotations

import ctypes
import hashlib
import operator
import sys
from collections.abc import Callable
from functools import cached_property
from typing import Any, TypeVar, cast

import numpy as np

from .kernels import address_of, are_interpreted
from .numba_internals import (
    COMPILED,
    AttributeTemplate,
    NativeValue,
    cgutils,
    impl_ret_borrowed,
    infer_getattr,
    intrinsic,
    ir,
    lower_getattr_generic,
    models,
    register_model,
    typeof,
    typeof_impl,
    types,
    unbox,
)

Class = TypeVar("Class", bound=type)

if not COMPILED:

    def by_reference(cls: Class) -> Class:
        """Return the class as it is: only compiled code would unpack its instances."""
        return cls

    def reference_at(address: int, example: Any) -> Any:
        """Raise: only compiled code has addresses."""
        raise RuntimeError("Nothing has an address without numba: look at are_interpreted() first.")

else:
    _BYTES = cgutils.voidptr_t
    _OWNERS = 2
    """Number of words of a compiled array that are for its owner; they come first."""

    class Reference(types.Type):
        """Numba's type of such a tuple: its class, and the types of its fields."""

        def __init__(self, cls: Any, fields: tuple[Any, ...]) -> None:
            self.cls, self.fields = cls, fields
            which = hashlib.sha256(repr(fields).encode()).hexdigest()[:12]
            super().__init__(f"{cls.__name__}_{which}")  # short: it is part of the name of every function that takes one

        @property
        def key(self) -> Any:
            """Key that is equal for equal types."""
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
        owned = isinstance(field, types.Array) and not context.enable_nrt  # without reference counts nobody needs the owner
        return impl_ret_borrowed(context, builder, field, _load(builder, place, _OWNERS if owned else 0))

    def _load(builder: Any, place: Any, skip: int = 0) -> Any:
        """Load a value number by number: the mark of a whole tuple's load would be lost when the compiler splits it."""
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
        """Get the address at which the instance has written down its fields."""
        builder = c.builder
        answer = c.pyapi.object_getattr_string(instance, "address")
        failed = cgutils.is_null(builder, answer)
        pointer = cgutils.alloca_once_value(builder, ir.Constant(_BYTES, None))
        with builder.if_then(builder.not_(failed), likely=True):
            builder.store(builder.inttoptr(c.pyapi.long_as_longlong(answer), _BYTES), pointer)
            c.pyapi.decref(answer)
        return NativeValue(builder.load(pointer), is_error=failed)

    def _has_pointer_behind_head(array: np.ndarray) -> bool:
        return _pointer_at(id(array) + object.__basicsize__) == array.ctypes.data

    def _pointer_at(address: int) -> int:
        return ctypes.c_ssize_t.from_address(address).value

    _QUICK = sys.implementation.name == "cpython" and _has_pointer_behind_head(np.zeros(1))
    """Whether the place of an array's numbers stands behind the head of its object, as numpy's C interface has it: asking for
    it there takes a fifth of the time, and a run of a study asks for hundreds."""

    def _data(array: np.ndarray) -> int:
        """Return the address of an array's numbers."""
        return _pointer_at(id(array) + object.__basicsize__) if _QUICK else array.ctypes.data

    def _written(value: Any) -> list[Any]:
        """Return the words that a field takes in compiled code."""
        if isinstance(value, np.ndarray):  # no reference is counted: the instance keeps its arrays
            return [0, id(value), value.size, value.itemsize, _data(value), *value.shape, *value.strides]
        if isinstance(value, tuple):
            return [cast(Any, value).address]
        return [operator.index(value)]

    _TYPE_FLAGS = 0x1 | 0x2 | 0x100 | 0x400
    """Of an array: C order, Fortran order, aligned and writeable. Together with type and dimensions, they make numba's type."""

    def _kind_of(field: Any) -> Any:
        """Return a key that is equal for fields of one numba type; asking numba takes longer than a short run."""
        if type(field) is np.ndarray:
            return field.dtype, field.ndim, field.flags.num & _TYPE_FLAGS
        if isinstance(field, tuple):
            return id(cast(Any, field).numba_type)  # which is kept for good
        return typeof(field)

    def by_reference(cls: Class) -> Class:
        """Make kernels take instances of a NamedTuple as one pointer; its fields are arrays, integers, or such tuples again."""
        _known: dict[tuple[Any, ...], Reference] = {}

        class Referred(cls):  # type: ignore[misc, valid-type]
            """The class with what compiled code needs of it."""

            @cached_property
            def numba_type(self) -> Reference:
                """Numba's type of this instance; instances with fields of equal types share one, which is looked up at once."""
                kind = tuple(_kind_of(field) for field in self)
                if kind not in _known:
                    _known[kind] = Reference(Referred, tuple(typeof(field) for field in self))
                return _known[kind]

            @cached_property
            def _words(self) -> np.ndarray:
                return np.array([word for field in self for word in _written(field)], np.int64)

            @cached_property
            def address(self) -> int:
                """Address at which the fields are written down; valid as long as this instance lives."""
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

    @intrinsic
    def reference_at(_context, address, example):  # type: ignore[no-untyped-def]
        """Return the tuple whose :attr:`address` is given, of the type of another one; for kernels that take many of a type."""

        def codegen(context, builder, signature, arguments):  # type: ignore[no-untyped-def]
            return builder.inttoptr(arguments[0], _BYTES)

        return example(types.int64, example), codegen


def call_of_range(function: Any, given: Any, plain: Callable[[int, int], None]) -> Callable[[int, int], None]:
    """Return a function that calls an :func:`.addressed_kernel` for the numbers from `first` to `last`, excluded.

    Its third argument is the tuple `given`, by reference. Numba's own way of calling takes longer than a step of a small
    sensor. Where kernels are interpreted `plain` is called.
    """
    address, place = address_of(function, 0, 0, given), address_of_fields(given)
    compiled = ctypes.CFUNCTYPE(None, ctypes.c_int64, ctypes.c_int64, ctypes.c_void_p)(address) if address else None

    def call(first: int, last: int) -> None:
        if compiled is not None and not are_interpreted():
            compiled(first, last, place)
        else:
            plain(first, last)

    call.given = given  # type: ignore[attr-defined]  # its address is valid as long as it lives
    return call


def address_of_fields(instance: Any) -> int:
    """Return the address of a tuple that is passed by reference, for :func:`reference_at`; zero without numba."""
    return int(instance.address) if COMPILED else 0

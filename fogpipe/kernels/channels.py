"""The four channels of a pixel as one number of compiled code.

The compiler turns long loops into vector code, but not the four equal lines of a pixel's channels. With ``load`` and
``store`` they are one value, of which ``+``, ``-`` and a factor on its left take one instruction.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic, models, overload, register_model


class Channels(types.Type):
    """Four numbers of a type that numba knows."""

    def __init__(self, dtype: types.Float) -> None:
        self.dtype = dtype
        super().__init__(name=f"Channels({dtype})")


@register_model(Channels)
class _Model(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        number = ir.FloatType() if kind.dtype.bitwidth == 32 else ir.DoubleType()
        super().__init__(manager, kind, ir.VectorType(number, 4))


def _instruction(generator: Callable[..., Any]) -> Any:
    """What compiled code calls with all arguments of the generator but the first, its typing context."""
    return intrinsic(generator)


@_instruction
def load(context, array, start):
    """The channels that begin at an index of a flat array."""
    kind = Channels(array.dtype)

    def generate(context, builder, signature, arguments):
        pointer = _pointer(context, builder, signature.args[0], arguments[0], arguments[1], 4)
        return builder.load(pointer, align=array.dtype.bitwidth // 8)

    return kind(array, start), generate


@_instruction
def store(context, array, start, channels):
    """Write channels to where they begin in a flat array."""

    def generate(context, builder, signature, arguments):
        pointer = _pointer(context, builder, signature.args[0], arguments[0], arguments[1], 4)
        builder.store(arguments[2], pointer, align=array.dtype.bitwidth // 8)
        return context.get_dummy_value()

    return types.void(array, start, channels), generate


SPLIT = 16
"""Pixels that ``split`` takes at once."""


@_instruction
def split(context, array, start, planes, place, apart):
    """Of 16 pixels in a flat array, the first channels to a place in another, the second ``apart`` numbers on, …"""

    def generate(context, builder, signature, arguments):
        size = array.dtype.bitwidth // 8
        source, start, target, place, apart = arguments
        pixels = builder.load(_pointer(context, builder, signature.args[0], source, start, 4 * SPLIT), align=size)
        for k in range(4):
            chosen = ir.Constant(ir.VectorType(ir.IntType(32), SPLIT), list(range(k, 4 * SPLIT, 4)))
            plane = builder.shuffle_vector(pixels, ir.Constant(pixels.type, ir.Undefined), chosen)
            pointer = _pointer(context, builder, signature.args[2], target, place, SPLIT)
            builder.store(plane, pointer, align=size)
            place = builder.add(place, apart)
        return context.get_dummy_value()

    return types.void(array, start, planes, place, apart), generate


@_instruction
def fetch(context, array, start):
    """Begin to bring what lies at an index of an array into the cache, since it is soon written."""

    def generate(context, builder, signature, arguments):
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        address, number = ir.IntType(8).as_pointer(), ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [address, number, number, number])
        prefetch = builder.module.declare_intrinsic("llvm.prefetch", [address], kind)
        to_write, keep, as_data = number(1), number(3), number(1)
        builder.call(prefetch, [builder.bitcast(builder.gep(data, [arguments[1]]), address), to_write, keep, as_data])
        return context.get_dummy_value()

    return types.void(array, start), generate


def _pointer(context: Any, builder: Any, kind: Any, array: Any, start: Any, count: int) -> Any:
    """To ``count`` numbers of an array as one vector."""
    data = context.make_array(kind)(context, builder, array).data
    vector = ir.VectorType(context.get_value_type(kind.dtype), count)
    return builder.bitcast(builder.gep(data, [start]), vector.as_pointer())


def _by_builder(name: str) -> Any:
    @_instruction
    def both(context, left, right):
        def generate(context, builder, signature, arguments):
            return getattr(builder, name)(*arguments)

        return left(left, right), generate

    return both


_add, _subtract = _by_builder("fadd"), _by_builder("fsub")


@_instruction
def _scaled(context, factor, channels):
    def generate(context, builder, signature, arguments):
        number = context.cast(builder, arguments[0], factor, channels.dtype)
        vector = ir.Constant(context.get_value_type(channels), ir.Undefined)
        for k in range(4):
            vector = builder.insert_element(vector, number, ir.Constant(ir.IntType(32), k))
        return builder.fmul(vector, arguments[1])

    return channels(factor, channels), generate


@overload(operator.add)
def _overload_add(left, right):
    if isinstance(left, Channels) and left == right:
        return lambda left, right: _add(left, right)
    return None


@overload(operator.sub)
def _overload_subtract(left, right):
    if isinstance(left, Channels) and left == right:
        return lambda left, right: _subtract(left, right)
    return None


@overload(operator.mul)
def _overload_multiply(factor, channels):
    if isinstance(factor, types.Float) and isinstance(channels, Channels):
        return lambda factor, channels: _scaled(factor, channels)
    return None

"""The four channels of a pixel, or sixteen numbers in a row, as one number of compiled code.

The compiler turns long loops into vector code, but not the four equal lines of a pixel's channels. With ``load`` and
``store`` they are one value, of which ``+``, ``-`` and a factor on its left take one instruction. ``load_many`` makes
one of sixteen numbers, where a loop would have to prove first that what it reads and writes are apart.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic, models, overload, register_model


class Numbers(types.Type):
    """So many numbers of a type that numba knows."""

    def __init__(self, dtype: types.Float, count: int) -> None:
        self.dtype = dtype
        self.count = count
        super().__init__(name=f"Numbers({dtype}, {count})")


@register_model(Numbers)
class _Model(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        number = ir.FloatType() if kind.dtype.bitwidth == 32 else ir.DoubleType()
        super().__init__(manager, kind, ir.VectorType(number, kind.count))


def _instruction(generator: Callable[..., Any]) -> Any:
    """What compiled code calls with all arguments of the generator but the first, its typing context."""
    return intrinsic(generator)


def _loader(array: Any, start: Any, count: int) -> Any:
    def generate(context, builder, signature, arguments):
        pointer = _pointer(context, builder, signature.args[0], arguments[0], arguments[1], count)
        return builder.load(pointer, align=array.dtype.bitwidth // 8)

    return Numbers(array.dtype, count)(array, start), generate


@_instruction
def load(context, array, start):
    """The channels that begin at an index of a flat array."""
    return _loader(array, start, 4)


@_instruction
def load_many(context, array, start):
    """As many numbers as ``split`` takes pixels."""
    return _loader(array, start, SPLIT)


@_instruction
def store(context, array, start, numbers):
    """Write numbers to where they begin in a flat array."""

    def generate(context, builder, signature, arguments):
        pointer = _pointer(context, builder, signature.args[0], arguments[0], arguments[1], numbers.count)
        builder.store(arguments[2], pointer, align=array.dtype.bitwidth // 8)
        return context.get_dummy_value()

    return types.void(array, start, numbers), generate


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
def merge(context, planes, place, apart, array, start):
    """The other way round: from four places in one array to 16 pixels in another."""

    def generate(context, builder, signature, arguments):
        size = array.dtype.bitwidth // 8
        source, place, apart, target, start = arguments
        rows = []
        for _ in range(4):
            pointer = _pointer(context, builder, signature.args[0], source, place, SPLIT)
            rows.append(builder.load(pointer, align=size))
            place = builder.add(place, apart)
        # Pairs of channels of a pixel first, as there is an instruction for them.
        two = [k // 2 + SPLIT * (k % 2) for k in range(2 * SPLIT)]
        pairs = _shuffled(builder, rows[0], rows[1], two), _shuffled(builder, rows[2], rows[3], two)
        four = [2 * (k // 4) + k % 2 + 2 * SPLIT * (k // 2 % 2) for k in range(4 * SPLIT)]
        pixels = _shuffled(builder, pairs[0], pairs[1], four)
        builder.store(pixels, _pointer(context, builder, signature.args[3], target, start, 4 * SPLIT), align=size)
        return context.get_dummy_value()

    return types.void(planes, place, apart, array, start), generate


def _shuffled(builder: Any, left: Any, right: Any, order: list[int]) -> Any:
    return builder.shuffle_vector(left, right, ir.Constant(ir.VectorType(ir.IntType(32), len(order)), order))


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


_add, _subtract, _multiply = _by_builder("fadd"), _by_builder("fsub"), _by_builder("fmul")


@_instruction
def _scaled(context, factor, numbers):
    def generate(context, builder, signature, arguments):
        number = context.cast(builder, arguments[0], factor, numbers.dtype)
        vector = ir.Constant(context.get_value_type(numbers), ir.Undefined)
        for k in range(numbers.count):
            vector = builder.insert_element(vector, number, ir.Constant(ir.IntType(32), k))
        return builder.fmul(vector, arguments[1])

    return numbers(factor, numbers), generate


@overload(operator.add)
def _overload_add(left, right):
    if isinstance(left, Numbers) and left == right:
        return lambda left, right: _add(left, right)
    return None


@overload(operator.sub)
def _overload_subtract(left, right):
    if isinstance(left, Numbers) and left == right:
        return lambda left, right: _subtract(left, right)
    return None


@overload(operator.mul)
def _overload_multiply(factor, numbers):
    if isinstance(numbers, Numbers) and factor == numbers:
        return lambda factor, numbers: _multiply(factor, numbers)
    if isinstance(numbers, Numbers) and isinstance(factor, types.Float):
        return lambda factor, numbers: _scaled(factor, numbers)
    return None

"""Sixteen neighbouring numbers from one array to another at once, in compiled loops.

LLVM leaves a loop that does so scalar, for fear that the arrays overlap.
"""

from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from render.rays.surface_rows import LANES


@intrinsic
def copy_lanes(_typing: Any, source: Any, first: Any, target: Any, to: Any) -> Any:
    """Copy `LANES` float32 from `source`, from index `first` on, to index `to` of `target`.

    Both are contiguous and have one axis. No bounds are checked.
    """
    signature = types.void(source, types.uint64, target, types.uint64)

    def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        vector = ir.VectorType(ir.FloatType(), LANES).as_pointer()

        def place(kind: Any, array: Any, index: Any) -> Any:
            data = context.make_array(kind)(context, builder, array).data
            return builder.bitcast(builder.gep(data, [index]), vector)

        values = builder.load(place(source, *arguments[:2]), align=4)
        builder.store(values, place(target, *arguments[2:]), align=4)
        return context.get_dummy_value()

    return signature, generate
